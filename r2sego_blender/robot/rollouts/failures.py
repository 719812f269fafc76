"""When a rollout has failed: the scope's conditions, judged on the simulation's state."""

from __future__ import annotations

import math
from enum import StrEnum

import mujoco
import numpy as np

from ..behaviours.trajectory import Seat
from ..model.composition import Composition, geom_bounds
from ..model.contacts import Contacts
from ..planning.free_floor import FLATNESS_M, FreeFloor
from ..scope.scope import BehaviourScope
from .quality import Meter

# On scene geoms that are more than floor a foot may stand where they are as flat as this.
_FLOOR_NORMAL_Z = 0.7
# MuJoCo counts these, and goes on from the resting robot at the origin.
_DIVERGED = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class Reason(StrEnum):
    """Why a rollout failed; ``NONE`` is a success."""

    NONE = ""
    NO_GOAL = "no_goal"
    FALL = "fall"
    BODY_CONTACT = "body_contact"
    LEFT_REGION = "left_region"
    TIME_OUT = "time_out"
    MISSED_TARGET = "missed_target"
    JOINT_LIMIT = "joint_limit"
    FOOT_SLIDE = "foot_slide"
    PENETRATION = "penetration"
    NON_FINITE = "non_finite"


Verdict = tuple[Reason, str]
"""A failure and its particulars."""

SUCCESS: Verdict = (Reason.NONE, "")


class Judge:
    """Judges rollouts of one robot in one scene."""

    def __init__(self, composition: Composition, floor: FreeFloor, scope: BehaviourScope, rest_height_m: float) -> None:
        self._composition = composition
        self._floor = floor
        self._failures = scope.failures
        self._seated_s = scope.sit_on.hold_s
        # A wheeled base has its origin anywhere, even on the floor: it falls over, it does not sink.
        self._lowest_m = -np.inf
        if composition.legs:
            self._lowest_m = floor.floor_z_m + scope.failures.fall_height * rest_height_m
        _, high = geom_bounds(composition.model)
        self._floor_geoms = composition.scene_geoms & (high[:, 2] < floor.floor_z_m + FLATNESS_M)

    def state(self, data: mujoco.MjData, contacts: Contacts, seat: Seat | None, meter: Meter) -> Verdict:
        """The first failure condition that holds now."""
        failures = self._failures
        finite = np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()
        if not finite or any(data.warning[kind].number for kind in _DIVERGED):
            return Reason.NON_FINITE, "the simulation diverged"
        lowest_m = self._lowest_m if seat is None else min(self._lowest_m, seat.height_m)
        if data.qpos[2] < lowest_m:
            return Reason.FALL, f"the pelvis sank to {data.qpos[2]:.2f} m"
        _, x, y, _ = data.qpos[3:7]
        tilt_deg = math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
        if tilt_deg > failures.fall_tilt_deg:
            return Reason.FALL, f"the pelvis tilted by {tilt_deg:.0f} degrees"
        if failures.body_contact and (touched := self._body_contact(contacts, seat)):
            return Reason.BODY_CONTACT, touched
        outside = failures.leaving_region and not self._floor.in_region(data.qpos[:2])
        if outside and (seat is None or not seat.is_near(data.qpos[:2])):
            return Reason.LEFT_REGION, f"the pelvis came to ({data.qpos[0]:.2f}, {data.qpos[1]:.2f})"
        if 0.0 < failures.slide_m < meter.foot_slide_m:
            return Reason.FOOT_SLIDE, f"a foot slid by {100.0 * meter.foot_slide_m:.1f} cm"
        if 0.0 < failures.penetration_m < meter.penetration_m:
            return Reason.PENETRATION, f"{100.0 * meter.penetration_m:.1f} cm deep"
        return self._joint_limit(data)

    def end(self, data: mujoco.MjData, goal: np.ndarray | None, seat: Seat | None, meter: Meter) -> Verdict:
        """What the finished rollout has missed."""
        if seat is not None and meter.seated_s < self._seated_s:
            return Reason.MISSED_TARGET, f"seated for {meter.seated_s:.1f} s at the end"
        missed_m = 0.0 if goal is None else math.dist(data.qpos[:2], goal)
        if missed_m > self._failures.goal_distance_m:
            return Reason.TIME_OUT, f"{missed_m:.2f} m from the goal"
        return SUCCESS

    def _body_contact(self, contacts: Contacts, seat: Seat | None) -> str:
        """What of the robot touches what of the scene, but for feet on the floor."""
        composition = self._composition
        flat = contacts.level > _FLOOR_NORMAL_Z
        flat &= np.abs(contacts.position_m[:, 2] - self._floor.floor_z_m) < FLATNESS_M
        allowed = composition.foot_geoms[contacts.robot] & (self._floor_geoms[contacts.scene] | flat)
        if seat is not None:
            allowed |= composition.seat_geoms[contacts.robot] & seat.holds(contacts.position_m)
        wrong = np.flatnonzero(~allowed)
        if not len(wrong):
            return ""
        robot, scene = contacts.robot[wrong[0]], contacts.scene[wrong[0]]
        return f"{composition.geom_label(robot)} touched {composition.geom_label(scene)}"

    def _joint_limit(self, data: mujoco.MjData) -> Verdict:
        model = self._composition.model
        joint, beyond_rad = _farthest_beyond(model, data, mujoco.mjtJoint.mjJNT_HINGE)
        if math.degrees(beyond_rad) > self._failures.joint_limit_deg:
            name = self._composition.joint_label(joint)
            return Reason.JOINT_LIMIT, f"{name} by {math.degrees(beyond_rad):.1f} degrees"
        joint, beyond_m = _farthest_beyond(model, data, mujoco.mjtJoint.mjJNT_SLIDE)
        if beyond_m > self._failures.joint_limit_m:
            name = self._composition.joint_label(joint)
            return Reason.JOINT_LIMIT, f"{name} by {100.0 * beyond_m:.1f} cm"
        return SUCCESS


def _farthest_beyond(model: mujoco.MjModel, data: mujoco.MjData, kind: mujoco.mjtJoint) -> tuple[int, float]:
    """The limited joint of a kind that is farthest beyond its limits, and by how much (rad or m).

    Negative where all are within them; (-1, -inf) where there is none.
    """
    joints = np.flatnonzero(model.jnt_limited.astype(bool) & (model.jnt_type == int(kind)))
    if not len(joints):
        return -1, -math.inf
    places = data.qpos[model.jnt_qposadr[joints]]
    low, high = model.jnt_range[joints].T
    beyond = np.maximum(low - places, places - high)
    worst = int(np.argmax(beyond))
    return int(joints[worst]), float(beyond[worst])
