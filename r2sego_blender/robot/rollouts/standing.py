"""Does the robot stand in the scene? Its standing posture, held for a while where the floor is free."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...config.settings import RolloutSettings
from ..behaviours.look_around import LookAround
from ..controllers.tracking import TrackingDrive
from ..controllers.velocity_pursuit import heading_rad
from ..model.composition import Composition, compose
from ..model.model import RobotModel
from ..motion.motion import plan_motion
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
    """The robot held its standing posture at ``place_m`` (2,), world x and y, facing ``yaw_rad``, for ``held_s``.

    ``offset_m``: the farthest its pelvis was above or below the posture's height; ``reason``
    and ``detail``: the failure that ended it, empty for none.
    """

    place_m: tuple[float, float]
    yaw_rad: float
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
    floor = free_floor(robot, scope, collision_mjcf)
    cells = np.argwhere(floor.free)
    nearest = np.linalg.norm(floor.points(*cells.T), axis=1).argmin()
    composition = compose(robot, collision_mjcf, settings)
    return stand_at(robot, composition, floor, scope, cells[nearest], np.random.default_rng(0))


def stand_at(
    robot: RobotModel,
    composition: Composition,
    floor: FreeFloor,
    scope: BehaviourScope,
    cell: np.ndarray,
    rng: np.random.Generator,
    held_s: float = _HELD_S,
) -> Standing:
    """Hold the standing posture in a free ``cell`` (2,), row and column, facing a way that ``rng`` draws."""
    still = replace(  # type: ignore[call-arg]  # of a behaviour
        scope,
        behaviours=Behaviours(walk_to=0.0, look_around=1.0),
        start=Start(heading_offset_deg=_STILL, pelvis_height=(_STANDING, _STANDING)),
        look_around=LookAround(turn_deg=_STILL),
        look=Look(camera_pitch_deg=None, waist_yaw_deg=_STILL, waist_pitch_deg=_STILL, hold_s=(1.0, 1.0)),
        episode=Episode(duration_s=held_s, camera_rate_hz=_SEEN_HZ),
    )
    alone = np.zeros_like(floor.free)
    alone[tuple(cell)] = True
    motion = plan_motion(robot, replace(floor, free=alone), still, rng, composition=composition)
    assert motion is not None  # to stand where it is takes no goal
    drive = TrackingDrive(composition, motion)
    held = simulate(composition, drive, Judge(composition, floor, still, robot.rest_height_m), _SEEN_HZ)
    offset_m = np.abs(held.qpos[:, 2] - drive.qpos[2]).max()
    return Standing(
        (float(drive.qpos[0]), float(drive.qpos[1])),
        heading_rad(drive.qpos),
        float(held.times_s[-1]),
        float(offset_m),
        str(held.reason),
        held.detail,
    )
