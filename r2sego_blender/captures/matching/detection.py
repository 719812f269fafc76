"""SIFT features of many images, on all cores: COLMAP's extractor keeps Python's lock, so in child processes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...core.progress import SILENT, Progress
from ...core.resources import available_cores
from ...core.scratch import ScratchFolder
from ...core.threads import in_threads
from ...workers.child import call_in_child
from .features import Features, grey_levels, sift_of_grey
from .overlap import load_matches, save_matches

_WORTH_PX = 3_000_000
"""Of all images: a child process takes half a second to start, and SIFT two for a megapixel."""
_AT_ONCE = 8  # images of a child: progress is told after them
_MOST_CHILDREN = 8  # an image of 1600 pixels takes half a gigabyte: its scales begin at twice its size
_TIMEOUT_S = 3600.0
_IMAGES, _FEATURES = "images.npz", "features.npz"


def sift_each(
    image: Callable[[int], np.ndarray],
    count: int,
    max_features: int,
    progress: Progress = SILENT,
    title: str = "Finding features",
) -> list[Features]:
    """``sift`` of each ``image(index)``, (H, W, 3) float32 in [0, 1] or uint8, below ``count``.

    ``image`` is called in threads where there is more than one core. The features are the same to the bit wherever
    they are found. Raises what ``image`` raises, and NativeError where the extractor ends its process.
    """
    if not count:
        return []
    first = grey_levels(image(0))

    def grey(index: int) -> np.ndarray:
        return first if index == 0 else grey_levels(image(index))

    def found(indices: range) -> list[Features]:
        return _in_child([grey(index) for index in indices], max_features)

    features: list[Features] = []
    children = min(available_cores(), _MOST_CHILDREN)
    with progress.task(title, count) as task:
        if children == 1 or first.size * count < _WORTH_PX:
            for index in range(count):
                features.append(sift_of_grey(grey(index), max_features))
                task.advance()
            return features
        step = min(-(-count // children), _AT_ONCE)
        parts = [range(start, min(start + step, count)) for start in range(0, count, step)]
        for part in in_threads(found, parts, threads=children):
            features += part
            task.advance(len(part))
    return features


def _in_child(greys: list[np.ndarray], max_features: int) -> list[Features]:
    with ScratchFolder() as folder:
        np.savez(Path(folder, _IMAGES), *greys)
        call_in_child(detect_in_child, {"folder": folder, "max_features": max_features}, timeout_s=_TIMEOUT_S)
        return load_matches(Path(folder, _FEATURES))[0]


def detect_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """The features of the images in a folder; runs in a child process."""
    folder = Path(request["folder"])
    with np.load(folder / _IMAGES, allow_pickle=False) as data:
        features = [sift_of_grey(data[name], request["max_features"]) for name in data.files]
    save_matches(folder / _FEATURES, features, {})
    return {}
