"""Footsteps of any number of legs under a root trajectory: planted feet, and swings with clearance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..behaviours.trajectory import RATE_HZ, RootTrajectory, eased
from ..model.model import RobotModel

# The slowest rhythm; small robots at speed take quicker steps, so that a foot strays from the
# middle of its stance by no more than this share of its leg.
_STEP_S = 0.5
_STRAY = 0.45
DOUBLE_SUPPORT = 0.24
"""Share of a step in which all feet stand."""

_CLEARANCE_M, _CLEARANCE = 0.05, 0.15  # at most, and as a share of the leg

MIN_STEP_M, MIN_STEP_RAD = 0.015, 0.05
"""A foot that would move less than this stays planted."""

SWAY_M, BOB_M = 0.018, 0.008
"""How far the base sways over the feet that stand, and how far it goes up and down."""

FULL_SPEED_M_S = 0.6
"""Speed at which bob and arm swing are full."""


@dataclass(frozen=True)
class Gait:
    """Foot and base references at ``RATE_HZ``, for the robot's legs in their order.

    ``feet`` (L, T, 4): x, y, sole height above the floor (m) and yaw (rad); ``load`` (L, T)
    the share of the weight each foot carries; ``sway_m``, ``bob_m`` (T,) the base's sideways
    (to the left) and upward motion; ``swing`` (T,) in [-1, 1], the arms' phase.
    """

    feet: np.ndarray
    load: np.ndarray
    sway_m: np.ndarray
    bob_m: np.ndarray
    swing: np.ndarray


def plan_gait(root: RootTrajectory, robot: RobotModel) -> Gait:
    """Steps of the two groups of legs in turn, each foot planted under the middle of its stance.

    One group swings while the other stands: bipeds alternate, quadrupeds trot, hexapods go
    on tripods. A planted foot does not move at all.
    """
    frames = len(root.yaw)
    times = np.arange(frames) / RATE_HZ
    if not robot.legs:
        still = np.zeros(frames)
        return Gait(np.empty((0, frames, 4)), np.empty((0, frames)), still, still, still)
    offsets = robot.foot_offsets_m
    step_s = _rhythm(root, offsets, robot.leg_m)
    support_s = DOUBLE_SUPPORT * step_s
    clearance_m = step_clearance_m(robot.leg_m)
    steps = int(np.ceil(times[-1] / step_s)) + 1
    feet, lift = np.empty((len(offsets), frames, 4)), np.zeros((len(offsets), frames))
    for foot, (leg, offset) in enumerate(zip(robot.legs, offsets, strict=True)):
        footholds = _footholds(root, times, (np.arange(steps) + 1.5) * step_s, offset)
        planted = _footholds(root, times, np.zeros(1), offset)[0]
        feet[foot] = (*planted[:2], 0.0, planted[2])
        for step in range(leg.group, steps, 2):
            lift_s = step * step_s + support_s / 2.0
            land_s = (step + 1) * step_s - support_s / 2.0
            moved = footholds[step] - planted
            if np.hypot(*moved[:2]) < MIN_STEP_M and abs(moved[2]) < MIN_STEP_RAD:
                continue
            phase = (times - lift_s) / (land_s - lift_s)
            path = planted + eased(phase)[:, None] * moved
            planted = footholds[step]
            landed = phase >= 1.0
            path[landed] = planted
            later = phase >= 0.0
            feet[foot, later] = path[later][:, [0, 1, 2, 2]]
            feet[foot, later, 2] = np.where(landed, 0.0, clearance_m * np.sin(np.pi * phase) ** 2)[later]
            ramp = np.minimum(times - lift_s, land_s - times) / support_s + 1.0
            lift[foot] = np.maximum(lift[foot], np.clip(ramp, 0.0, 1.0))
    load = 1.0 - lift
    load = load / load.sum(axis=0)
    effort = np.clip(np.abs(root.speed) / FULL_SPEED_M_S, 0.0, 1.0)
    sway = SWAY_M * (offsets[:, 1] @ load) / np.abs(offsets[:, 1]).max()
    # The first group swings in even steps, with the arms of the other side forward.
    swing = np.sin(np.pi * (times / step_s - 0.5)) * effort
    bob = -BOB_M * np.cos(2.0 * np.pi * times / step_s) * effort
    return Gait(feet, load, _smooth(sway, support_s), bob, swing)


def _rhythm(root: RootTrajectory, offsets: np.ndarray, leg_m: float) -> float:
    """Seconds a step takes at this trajectory's greatest foot speed."""
    walked_m_s = np.linalg.norm(np.gradient(root.xy, 1.0 / RATE_HZ, axis=0), axis=1)
    turned_m_s = np.abs(np.gradient(root.yaw, 1.0 / RATE_HZ)) * np.linalg.norm(offsets, axis=1).max()
    return step_seconds((walked_m_s + turned_m_s).max(), leg_m)


def step_seconds(foot_m_s: float, leg_m: float) -> float:
    """Seconds a step takes where feet go at ``foot_m_s`` under legs of ``leg_m``."""
    # A stance lasts a step and half of each double support.
    stance_m = 2.0 * _STRAY * leg_m
    return min(_STEP_S, stance_m / ((1.0 + DOUBLE_SUPPORT) * max(foot_m_s, 1e-6)))


def step_clearance_m(leg_m: float) -> float:
    """How high a foot is lifted, of legs of ``leg_m``."""
    return min(_CLEARANCE_M, _CLEARANCE * leg_m)


def _footholds(root: RootTrajectory, times: np.ndarray, at_s: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
    """(n, 3) x, y, yaw of a foot under the root at times ``at_s`` (n,)."""
    yaw = np.interp(at_s, times, root.yaw)
    cos, sin = np.cos(yaw), np.sin(yaw)
    x = np.interp(at_s, times, root.xy[:, 0]) + cos * offset_m[0] - sin * offset_m[1]
    y = np.interp(at_s, times, root.xy[:, 1]) + sin * offset_m[0] + cos * offset_m[1]
    return np.stack([x, y, yaw], axis=1)


def _smooth(signal: np.ndarray, seconds: float) -> np.ndarray:
    """``signal`` averaged over ``seconds``, so that its velocity is bounded."""
    width = max(1, round(seconds * RATE_HZ))
    padded = np.pad(signal, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
