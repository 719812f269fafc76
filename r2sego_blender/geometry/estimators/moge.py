"""MoGe-2 (Wang et al., 2025): metric depth of one photograph, by its field of view.

Read: github.com/microsoft/MoGe at 07444410f1e33f402353b99d6ccd26bd31e469e8 (package moge 2.0.0). Its code and
weights are under MIT, its copy of DINOv2 under Apache-2.0.

In: one picture in [0, 1] at a time, of any size and square pixels, here 960 pixels at the longer side, as many
as its 3600 tokens of 14 pixels show; the horizontal field of view in degrees, of a lens whose principal point is
in the middle: it knows no other, so what one beside it does is left to the alignment.
Out: planar ``depth`` of the picture's size in metres, infinite where its mask leaves out sky and what it does not
know; no confidence, no pose.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from ...captures.capture import Capture
from .learned import MAP, LearnedEstimator, Seen
from .placement import Placement

BACKENDS = {"moge-2": "MoGe-2"}
ORDER = 4

_LONGEST = 960


class Estimator(LearnedEstimator):
    """See ``LearnedEstimator``."""

    answers: ClassVar[Mapping[str, tuple[int | None, ...]]] = {"depth": MAP}

    def placements(self, sizes: Sequence[tuple[int, int]]) -> list[Placement]:
        """The whole photograph, nothing beside it."""
        scaled = [[max(1, round(side * _LONGEST / max(size))) for side in size] for size in sizes]
        return [Placement(*sides, *sides) for sides in scaled]

    def request(self, captures: Sequence[Capture], placements: Sequence[Placement]) -> dict[str, np.ndarray]:
        """``fov_x`` (n,) float64, degrees."""
        lenses = [one.camera for one in captures]
        return {"fov_x": np.array([math.degrees(2 * math.atan(0.5 * one.width / one.fx)) for one in lenses])}

    def seen(self, said: Mapping[str, np.ndarray], placements: Sequence[Placement]) -> list[Seen]:
        """See ``LearnedEstimator``."""
        return [Seen(one) for one in said["depth"]]
