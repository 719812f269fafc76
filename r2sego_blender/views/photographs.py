"""Photographs that a person had better take: cameras, and what each would show. NumPy alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..core.cameras import Camera
from ..core.json_files import finite_number


@dataclass(frozen=True)
class PhotographToTake:
    """A photograph of what no capture shows well.

    ``camera`` is where to stand with the captures' lens; ``share`` in [0, 1] is what it would show,
    of all that the asset lacks in the robot's views and no capture saw well, and no photograph
    before it in a list shows.
    """

    camera: Camera
    share: float

    @property
    def yaw_deg(self) -> float:
        """Where it looks, level: 0 along the world's x, 90 along y."""
        ahead = self.camera.forward
        return math.degrees(math.atan2(ahead[1], ahead[0]))

    @property
    def down_deg(self) -> float:
        """How far below the horizon it looks."""
        return -math.degrees(math.asin(min(1.0, max(-1.0, float(self.camera.forward[2])))))

    def in_words(self) -> str:
        """Where to stand and look, for a sentence."""
        x, y, z = self.camera.centre
        return (
            f"at x {x:.1f} m, y {y:.1f} m, the camera {z:.1f} m high, look towards {self.yaw_deg:.0f}° "
            f"and {self.down_deg:.0f}° down ({self.share:.0%} of it)"
        )

    def to_json(self) -> dict[str, Any]:
        """JSON-ready: the camera, what it would show, and the same for people."""
        x, y, z = (round(float(value), 3) for value in self.camera.centre)
        place = {"x_m": x, "y_m": y, "height_m": z}
        looks = {"yaw_deg": round(self.yaw_deg, 1), "down_deg": round(self.down_deg, 1)}
        return {**place, **looks, "share": self.share, "camera": self.camera.to_json()}

    @staticmethod
    def from_json(told: Any) -> PhotographToTake:
        """What ``to_json`` told. Raises KeyError, TypeError or ValueError for anything else."""
        share = finite_number(told["share"])
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"a share of {share}")
        return PhotographToTake(Camera.from_json(told["camera"]), share)


def advice(lacking: float, photographs: Sequence[PhotographToTake]) -> str:
    """One sentence: what the captures lack, a share in [0, 1], and the next photographs to take; "" for none."""
    if not photographs:
        return ""
    return f"of what the asset lacks in the robot's views no photograph shows {lacking:.0%} well: {places(photographs)}"


def places(photographs: Sequence[PhotographToTake]) -> str:
    """The photographs to take, for the end of a sentence."""
    return "to take next, " + "; then ".join(one.in_words() for one in photographs)
