"""Footsteps under a root trajectory: planted feet, and swings with clearance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .behaviours import RootTrajectory
from .navigation import RATE_HZ

STEP_S = 0.5
_DOUBLE_SUPPORT_S = 0.12
_SWING_CLEARANCE_M = 0.05
# A foot that would move less than this stays planted.
_MIN_STEP_M = 0.015
_MIN_STEP_RAD = 0.05
_SWAY_M = 0.018
_BOB_M = 0.008
# Speed at which sway, bob and arm swing are full.
_FULL_SPEED_M_S = 0.6


@dataclass(frozen=True)
class Gait:
    """Foot and pelvis references at ``RATE_HZ``; the first foot is the left one.

    ``feet`` (2, T, 4): x, y, sole height above the floor (m) and yaw (rad); ``load`` (2, T)
    the share of the weight each foot carries; ``sway_m``, ``bob_m`` (T,) the pelvis' sideways
    (to the left) and upward motion; ``swing`` (T,) in [-1, 1], the arms' phase.
    """

    feet: np.ndarray
    load: np.ndarray
    sway_m: np.ndarray
    bob_m: np.ndarray
    swing: np.ndarray


def plan_gait(root: RootTrajectory, foot_offsets_m: np.ndarray) -> Gait:
    """Alternate steps of ``STEP_S`` that keep each foot under the middle of its stance.

    ``foot_offsets_m`` (2, 2): the feet's (x, y) below the resting pelvis.
    """
    frames = len(root.yaw)
    times = np.arange(frames) / RATE_HZ
    steps = int(np.ceil(times[-1] / STEP_S)) + 1
    feet, lift = np.empty((2, frames, 4)), np.zeros((2, frames))
    for foot, offset in enumerate(foot_offsets_m):
        planted = _foothold(root, times, np.zeros(1), offset)[0]
        feet[foot] = (*planted[:2], 0.0, planted[2])
        for step in range(foot, steps, 2):
            lift_s = step * STEP_S + _DOUBLE_SUPPORT_S / 2.0
            land_s = (step + 1) * STEP_S - _DOUBLE_SUPPORT_S / 2.0
            target = _foothold(root, times, np.array([(step + 1.5) * STEP_S]), offset)[0]
            moved = target - planted
            if np.hypot(*moved[:2]) < _MIN_STEP_M and abs(moved[2]) < _MIN_STEP_RAD:
                continue
            phase = np.clip((times - lift_s) / (land_s - lift_s), 0.0, 1.0)
            ease = phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)
            later = times >= lift_s
            path = planted + ease[:, None] * moved
            feet[foot, later] = path[later][:, [0, 1, 2, 2]]
            feet[foot, later, 2] = (_SWING_CLEARANCE_M * np.sin(np.pi * phase) ** 2)[later]
            ramp = np.minimum(times - lift_s, land_s - times) / _DOUBLE_SUPPORT_S + 1.0
            lift[foot] = np.maximum(lift[foot], np.clip(ramp, 0.0, 1.0))
            planted = target
    load = 1.0 - lift
    load = load / load.sum(axis=0)
    effort = np.clip(np.abs(root.speed) / _FULL_SPEED_M_S, 0.0, 1.0)
    sway = (load[0] - load[1]) * _SWAY_M
    # The left foot swings in even steps, with the right arm forward.
    swing = np.sin(np.pi * (times / STEP_S - 0.5)) * effort
    bob = -_BOB_M * np.cos(2.0 * np.pi * times / STEP_S) * effort
    return Gait(feet, load, _smooth(sway), bob, swing)


def _foothold(root: RootTrajectory, times: np.ndarray, at_s: np.ndarray, offset_m: np.ndarray) -> np.ndarray:
    """(n, 3) x, y, yaw of a foot under the root at times ``at_s`` (n,)."""
    yaw = np.interp(at_s, times, root.yaw)
    cos, sin = np.cos(yaw), np.sin(yaw)
    x = np.interp(at_s, times, root.xy[:, 0]) + cos * offset_m[0] - sin * offset_m[1]
    y = np.interp(at_s, times, root.xy[:, 1]) + sin * offset_m[0] + cos * offset_m[1]
    return np.stack([x, y, yaw], axis=1)


def _smooth(signal: np.ndarray) -> np.ndarray:
    """``signal`` averaged over the double support, so that its velocity is bounded."""
    width = round(_DOUBLE_SUPPORT_S * RATE_HZ)
    padded = np.pad(signal, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
