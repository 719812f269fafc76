"""Does the robot stand in the scene? Its standing posture, held for a while where the floor is free."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...config.settings import RolloutSettings
from ...core.errors import RobotError
from ..behaviours.look_around import LookAround
from ..controllers.tracking import TrackingController
from ..model.model import RobotModel
from ..planning.free_floor import FreeFloor, free_floor
from ..scope.scope import Behaviours, BehaviourScope, Episode, Look, Start
from .failures import Judge
from .simulation import simulate

STANDS_WITHIN_M = 0.05
"""How far the pelvis may leave its height."""

_HELD_S = 2.0
_SEEN_HZ = 25.0
_STANDING = 0.98  # share of the height with straight legs, which carry badly
_STILL = (0.0, 0.0)


@dataclass(frozen=True)
class Standing:
    """The robot held its standing posture at ``place_m`` (2,), world x and y, for ``held_s``.

    ``offset_m``: the farthest its pelvis was above or below the posture's height; ``reason``
    and ``detail``: the failure that ended it, empty for none.
    """

    place_m: tuple[float, float]
    held_s: float
    offset_m: float
    reason: str
    detail: str

    @property
    def stands(self) -> bool:
        """To the end, with the pelvis within 5 cm of its height."""
        return not self.reason and self.offset_m <= STANDS_WITHIN_M


def stand(robot: RobotModel, scope: BehaviourScope, collision_mjcf: Path, settings: RolloutSettings) -> Standing:
    """Hold the standing posture for two seconds, as rollouts track their references.

    The robot stands where the floor is free, as near the world's origin as that allows.
    Raises RobotError where the scene does not compile or has no free floor.
    """
    floor = _nearest_to_origin(free_floor(robot, scope, collision_mjcf))
    still = replace(  # type: ignore[call-arg]  # of a behaviour
        scope,
        behaviours=Behaviours(walk_to=0.0, look_around=1.0),
        start=Start(heading_offset_deg=_STILL, pelvis_height=(_STANDING, _STANDING)),
        look_around=LookAround(turn_deg=_STILL),
        look=Look(camera_pitch_deg=None, waist_yaw_deg=_STILL, waist_pitch_deg=_STILL, hold_s=(1.0, 1.0)),
        episode=Episode(duration_s=_HELD_S, camera_rate_hz=_SEEN_HZ),
    )
    controller = TrackingController(robot, floor, still, collision_mjcf, settings)
    drive = controller.draw(np.random.default_rng(0))
    if drive is None:
        raise RobotError("the robot finds no place to stand", where=collision_mjcf, cure="Check the floor.")
    judge = Judge(controller.composition, floor, still, robot.rest_height_m)
    held = simulate(controller.composition, drive, judge, _SEEN_HZ)
    offset_m = np.abs(held.qpos[:, 2] - drive.qpos[2]).max()
    place = drive.qpos[:2]
    return Standing(
        (float(place[0]), float(place[1])), float(held.times_s[-1]), float(offset_m), str(held.reason), held.detail
    )


def _nearest_to_origin(floor: FreeFloor) -> FreeFloor:
    """The floor with one free cell, the nearest to the world's origin."""
    rows, columns = np.nonzero(floor.free)
    nearest = np.linalg.norm(floor.points(rows, columns), axis=1).argmin()
    free = np.zeros_like(floor.free)
    free[rows[nearest], columns[nearest]] = True
    return replace(floor, free=free)
