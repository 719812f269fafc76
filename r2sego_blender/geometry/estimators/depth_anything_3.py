"""Depth Anything 3 (Lin et al., 2025): depth of any number of photographs, by their poses where these are known.

Read: github.com/ByteDance-Seed/Depth-Anything-3 at 2c21ea849ceec7b469a3e62ea0c0e270afc3281a (package
depth-anything-3). Its code is under Apache-2.0, and so are the weights DA3-SMALL and DA3-BASE; LARGE and
GIANT are CC BY-NC 4.0 and not asked for.

In: pictures of one size whose longer side is 504, each side the nearest multiple of 14, stretched to it; with
them intrinsics in pixels and ``camera_from_world`` in OpenCV axes. It brings its own poses to these by a
similarity, so they are told only where the centres span a plane; without them the unit is its own.
Out: planar depth of each picture in the order given, confidence of at least 1 (1 + exp).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from .learned import MAP, LearnedEstimator, Seen, camera_found, inverted
from .placement import Placement

BACKENDS = {"depth-anything-3-base": "Depth Anything 3, BASE", "depth-anything-3-small": "Depth Anything 3, SMALL"}
ORDER = 1

_LONGEST = 504
_PATCH = 14
_LEAST_SPREAD = 0.1  # of the centres beside their line, of that along it


class Estimator(LearnedEstimator):
    """See ``LearnedEstimator``."""

    answers: ClassVar[Mapping[str, tuple[int | None, ...]]] = {
        "depth": MAP,
        "confidence": MAP,
        "intrinsics": (3, 3),
        "camera_from_world": (3, 4),
    }

    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """As its ``upper_bound_resize`` does: nothing is cropped."""
        return [_placement(width, height) for width, height in sizes]

    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """``intrinsics`` (n, 3, 3) and ``camera_from_world`` (n, 4, 4) float64, where the centres tell the pose."""
        if not span_a_plane(np.array([one.camera.centre for one in captures])):
            return {}
        return {
            "intrinsics": np.stack([p.matrix(one.camera) for one, p in zip(captures, placements, strict=True)]),
            "camera_from_world": np.stack([one.camera.camera_from_world for one in captures]),
        }

    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """See ``LearnedEstimator``."""
        matrices, poses = said["intrinsics"], said["camera_from_world"]
        return [
            Seen(said["depth"][k], said["confidence"][k], camera_found(matrices[k], inverted(poses[k]), place))
            for k, place in enumerate(placements)
        ]


def span_a_plane(centres: np.ndarray) -> bool:
    """Whether (n, 3) do not lie on a line or at a point: a similarity of poses is found by no fewer."""
    spread = np.linalg.svd(centres - centres.mean(axis=0), compute_uv=False)
    return len(centres) >= 3 and bool(spread[0] > 0.0) and bool(spread[1] > _LEAST_SPREAD * spread[0])


def _placement(width: int, height: int) -> Placement:
    scale = _LONGEST / float(max(width, height))
    sides = [_multiple(max(1, round(side * scale))) for side in (width, height)]
    return Placement(*sides, *sides)


def _multiple(side: int) -> int:
    """The nearest multiple of a patch's side, the greater of two."""
    return max(_PATCH, (2 * side + _PATCH) // (2 * _PATCH) * _PATCH)
