"""Reference motions: joint trajectories of the declared behaviours, for a controller to track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..behaviours.trajectory import RATE_HZ, STAND_OFF_M, RootTrajectory, Seat
from ..model.composition import Composition
from ..model.kinematics import LegSolver
from ..model.model import RobotModel
from ..model.mount import CameraMount
from ..planning.course import draw, plan_root
from ..planning.free_floor import FreeFloor
from ..scope.scope import BehaviourScope
from .dynamics import inverse_dynamics
from .gait import Gait, plan_gait
from .sitting import seated_height
from .upper_body import upper_body

# The seat begins to carry the weight at this part of the way down.
_TOUCHES = 0.97
_SHALLOWER_M = 0.02


@dataclass(frozen=True)
class ReferenceMotion:
    """A robot's reference at ``RATE_HZ``.

    ``qpos`` (T, nq), ``qvel`` (T, nv) and ``torque`` (T, nv) float64, MuJoCo's coordinates:
    the joints' torques of the inverse dynamics and, in the base's rows, the residual wrench;
    ``goal`` (2,) is where it has to end, None for anywhere; ``mount`` the camera of this
    rollout; ``seat`` what it sits on, if anything.
    """

    behaviour: str
    qpos: np.ndarray
    qvel: np.ndarray
    torque: np.ndarray
    goal: np.ndarray | None
    mount: CameraMount
    seat: Seat | None = None


def plan_motion(
    robot: RobotModel,
    floor: FreeFloor,
    scope: BehaviourScope,
    rng: np.random.Generator,
    seats: Sequence[Seat] = (),
    composition: Composition | None = None,
) -> ReferenceMotion | None:
    """Draw a motion in the scope; None where the floor offers no goal.

    To sit down on one of ``seats`` takes the ``composition`` with the scene.
    """
    root = plan_root(floor, scope, rng, seats)
    if root is None:
        return None
    share = draw(scope.start.pelvis_height, rng)
    height_m = robot.rest_height_m * (1.0 if robot.is_wheeled else share)
    pitch = scope.look.camera_pitch_deg
    mount = robot.mount if pitch is None else robot.mount.pitched(draw(pitch, rng))
    gait = plan_gait(root, robot)
    qpos = upper_body(robot, root, gait, scope, rng)
    soles = gait.feet.copy()
    soles[..., 2] += floor.floor_z_m + np.array([leg.sole_m for leg in robot.legs])[:, None]
    standing_z_m = floor.floor_z_m + height_m
    _place_base(robot, root, gait, qpos, standing_z_m)
    if root.seat is not None and composition is not None:
        seated_m = _sit(robot, composition, root, root.seat, qpos, soles[:, -1])
        if seated_m is None:
            return None
        qpos[:, 2] -= root.sit * (standing_z_m - seated_m)
    LegSolver(robot).solve(qpos, soles)
    _roll_wheels(robot, qpos, root.yaw)
    seat_load = np.clip((root.sit - _TOUCHES) / (1.0 - _TOUCHES), 0.0, 1.0)
    qvel, torque = inverse_dynamics(robot, qpos, gait, floor.floor_z_m, seat_load)
    return ReferenceMotion(root.behaviour, qpos, qvel, torque, root.goal, mount, root.seat)


def _place_base(robot: RobotModel, root: RootTrajectory, gait: Gait, qpos: np.ndarray, standing_z_m: float) -> None:
    """Write the base's pose into ``qpos`` (T, nq): on its way, swaying, crouching."""
    cos, sin = np.cos(root.yaw), np.sin(root.yaw)
    sway_m = gait.sway_m * (1.0 - root.sit)
    qpos[:, 0] = root.xy[:, 0] - sin * sway_m
    qpos[:, 1] = root.xy[:, 1] + cos * sway_m
    qpos[:, 2] = standing_z_m + gait.bob_m - root.crouch * robot.rest_height_m
    qpos[:, 3:7] = 0.0
    qpos[:, 3], qpos[:, 6] = np.cos(root.yaw / 2.0), np.sin(root.yaw / 2.0)


def _sit(
    robot: RobotModel, composition: Composition, root: RootTrajectory, seat: Seat, qpos: np.ndarray, soles: np.ndarray
) -> float | None:
    """Move the base in ``qpos`` (T, nq) back onto ``seat``; the height it comes to rest at.

    Where the legs are too short to sit as deep as drawn it sits nearer to the edge; None
    where they are too short for that too.
    """
    standing = qpos[:, :2].copy()
    for depth_m in np.arange(root.depth_m, 0.0, -_SHALLOWER_M):
        qpos[:, :2] = standing + root.sit[:, None] * (seat.ahead(-depth_m) - seat.ahead(STAND_OFF_M))
        height_m = seated_height(robot, composition, qpos[-1], soles, seat)
        if height_m is not None:
            return height_m
    return None


def _roll_wheels(robot: RobotModel, qpos: np.ndarray, yaw: np.ndarray) -> None:
    """Write the wheels' angles into ``qpos`` (T, nq) in place, for the base's path in it.

    ``yaw`` (T,) radians is the base's heading, not wrapped. Only motion along the heading
    turns a wheel: what goes sideways slips.
    """
    velocity = np.gradient(qpos[:, :2], 1.0 / RATE_HZ, axis=0)
    forward_m_s = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    rate = np.gradient(yaw, 1.0 / RATE_HZ)
    for wheel in robot.wheels:
        rim_m_s = forward_m_s - rate * wheel.offset_m[1]
        rolled_m = np.concatenate([[0.0], np.cumsum(0.5 * (rim_m_s[1:] + rim_m_s[:-1])) / RATE_HZ])
        qpos[:, robot.model.jnt_qposadr[wheel.joint]] += wheel.forward * rolled_m / wheel.radius_m
