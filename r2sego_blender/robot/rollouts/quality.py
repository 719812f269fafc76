"""How well a rollout was carried out, measured in its simulation."""

from __future__ import annotations

import mujoco
import numpy as np

from ..behaviours.trajectory import Seat
from ..model.composition import Composition
from ..model.contacts import SEATED_LOAD, Contacts
from .rollout import Quality

# More than this share of the robot's weight on a foot is stance.
_STANCE_LOAD = 0.1


class Meter:
    """Measures a simulation as it goes on; told every ``period_s``."""

    def __init__(self, composition: Composition, seat: Seat | None, period_s: float) -> None:
        self._composition, self._seat, self._period_s = composition, seat, period_s
        self._weight_n = composition.robot_mass_kg * 9.81
        of_body = composition.model.geom_bodyid
        self._on_foot = [np.isin(of_body, leg.foot_bodies) for leg in composition.legs]  # (ngeom,) bool a leg
        self._planted: dict[int, np.ndarray] = {}
        self._assist_n: list[float] = []
        self.foot_slide_m = self.penetration_m = self.seated_s = 0.0

    def read(self, data: mujoco.MjData, contacts: Contacts) -> None:
        """Take the state in ``data`` into account."""
        composition = self._composition
        self.penetration_m = max(self.penetration_m, contacts.depth_m.max(initial=0.0))
        for leg, on_foot in zip(composition.legs, self._on_foot, strict=True):
            if contacts.force_n[on_foot[contacts.robot]].sum() < _STANCE_LOAD * self._weight_n:
                self._planted.pop(leg.foot, None)
                continue
            place = leg.tip_place(data)[:2]
            start = self._planted.setdefault(leg.foot, place)
            self.foot_slide_m = max(self.foot_slide_m, float(np.linalg.norm(place - start)))
        if self._seat is not None:
            on_seat = composition.seat_geoms[contacts.robot] & self._seat.holds(contacts.position_m)
            carried_n = (contacts.force_n * contacts.level)[on_seat].sum()
            seated = carried_n >= SEATED_LOAD * self._weight_n
            self.seated_s = self.seated_s + self._period_s if seated else 0.0
        if composition.has_wrench:
            self._assist_n.append(float(np.linalg.norm(data.actuator_force[:3])))

    def quality(self, camera_poses: np.ndarray) -> Quality:
        """The measurements, with those of the camera's poses (T, 4, 4)."""
        height = camera_poses[:, 2, 3]
        pitch = np.degrees(np.arcsin(np.clip(-camera_poses[:, 2, 2], -1.0, 1.0)))
        return Quality(
            foot_slide_m=self.foot_slide_m,
            penetration_m=float(self.penetration_m),
            seated_s=self.seated_s,
            assist_n=float(np.mean(self._assist_n)) if self._assist_n else 0.0,
            camera_height_m=(float(height.min()), float(height.max())),
            camera_pitch_deg=(float(pitch.min()), float(pitch.max())),
        )
