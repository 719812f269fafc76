"""A room as a box on the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.cameras import Camera
from .segments import room_axes

SIDES = ("x low", "x high", "y low", "y high", "floor", "ceiling")
FLOOR = 4


@dataclass(frozen=True)
class RoomBox:
    """``turn`` about z, rad, of the room's axes; ``low``, ``high`` (3,) in these axes, metres; ``sigma`` (6,) metres of
    the sides in the order of ``SIDES``. ``share`` of the segments' length that follows the axes."""

    turn: float
    low: np.ndarray
    high: np.ndarray
    sigma: np.ndarray
    share: float

    @property
    def axes(self) -> np.ndarray:
        """(3, 3): rows are the room's axes in the world."""
        return room_axes(self.turn)

    @property
    def sides(self) -> np.ndarray:
        """(6,) metres along the axes, in the order of ``SIDES``."""
        return np.stack([self.low, self.high], 1).ravel()

    def hit(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """For each pixel the planar depth (H, W) float64 of the box and which of ``SIDES`` it shows (H, W)."""
        rays = camera.rays() @ (self.axes @ camera.world_from_camera[:3, :3]).T
        origin = self.axes @ camera.centre
        safe = np.where(np.abs(rays) < 1e-9, 1e-9, rays)
        ends = np.where(safe > 0.0, (self.high - origin) / safe, (self.low - origin) / safe)
        axis = ends.argmin(-1)
        ahead = np.take_along_axis(safe, axis[..., None], -1)[..., 0] > 0.0
        return ends.min(-1), 2 * axis + ahead
