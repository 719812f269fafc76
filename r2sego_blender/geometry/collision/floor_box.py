"""The floor of a collision surface as the box that simulators get."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_THICKNESS_M = 0.2


@dataclass(frozen=True)
class FloorBox:
    """The floor as a box with its top at the floor's height: ``centre`` (3,), ``half`` (3,)
    sizes along its own axes, which are the world's turned by ``yaw_rad`` about z."""

    centre: np.ndarray
    half: np.ndarray
    yaw_rad: float

    @staticmethod
    def of(floor: np.ndarray) -> FloorBox:
        """The box under the rectangle ``floor`` (4, 3) of a CollisionSurface."""
        right, ahead = floor[1] - floor[0], floor[3] - floor[0]
        half = np.array([np.linalg.norm(right), np.linalg.norm(ahead), _THICKNESS_M]) / 2
        centre = floor.mean(0) - (0.0, 0.0, half[2])
        return FloorBox(centre, half, float(np.arctan2(right[1], right[0])))
