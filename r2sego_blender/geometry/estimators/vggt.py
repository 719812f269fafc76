"""VGGT (Wang et al., CVPR 2025): depth and cameras of up to hundreds of photographs, of these alone.

Read: github.com/facebookresearch/vggt, README.md and vggt/utils/load_fn.py as stored at
2494ff77a6b7001cbee879db844317e17102bb75 and 08014932250c51d3c56db263e2c68a04a9205ef3, and the network with
its heads and geometry as github.com/facebookresearch/map-anything has them at
f7ebafb4d8349776705aaa686cf928988d1bd7f4. Code is under Meta's VGGT licence, the weights VGGT-1B under CC BY-NC 4.0;
VGGT-1B-Commercial, under the VGGT licence, is given on request and not asked for.

In: pictures in [0, 1] and nothing else. As its ``load_and_preprocess_images`` does, the longer side is 518 and
the other the nearest multiple of 14, stretched to it; photographs that are not all of one landscape shape
lie in the middle of a white square of 518.
Out: planar depth of each picture in the order given, confidence of at least 1 (1 + exp), intrinsics with the
principal point in the middle, and ``camera_from_world`` (3, 4) in OpenCV axes, where the world is the first
picture's camera, nearly; all in one unit of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from .learned import MAP, LearnedEstimator, Seen, camera_found, inverted
from .placement import Placement

BACKENDS = {"vggt": "VGGT"}
ORDER = 3

_LONGEST = 518
_PATCH = 14


class Estimator(LearnedEstimator):
    """See ``LearnedEstimator``."""

    answers: ClassVar[Mapping[str, tuple[int | None, ...]]] = {
        "depth": MAP,
        "confidence": MAP,
        "intrinsics": (3, 3),
        "camera_from_world": (3, 4),
    }

    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """Landscapes of one shape fill their pictures, any others are padded."""
        sides = [_sides(width, height) for width, height in sizes]
        if len(set(sides)) == 1 and sides[0][1] <= sides[0][0]:
            return [Placement(*one, *one) for one in sides]
        return [
            Placement(_LONGEST, _LONGEST, across, down, (_LONGEST - across) // 2, (_LONGEST - down) // 2)
            for across, down in sides
        ]

    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """It takes pictures alone."""
        return {}

    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """See ``LearnedEstimator``."""
        matrices, poses = said["intrinsics"], said["camera_from_world"]
        return [
            Seen(said["depth"][k], said["confidence"][k], camera_found(matrices[k], inverted(poses[k]), place))
            for k, place in enumerate(placements)
        ]


def _sides(width: int, height: int) -> tuple[int, int]:
    """(width, height) of a photograph in its picture."""
    if width >= height:
        return _LONGEST, max(1, round(height * (_LONGEST / width) / _PATCH)) * _PATCH
    return max(1, round(width * (_LONGEST / height) / _PATCH)) * _PATCH, _LONGEST
