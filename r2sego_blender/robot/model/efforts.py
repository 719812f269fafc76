"""How hard a robot's file lets its joints be driven."""

from __future__ import annotations

import mujoco
import numpy as np

from .structure import on_joints

_NO_BIAS = int(mujoco.mjtBias.mjBIAS_NONE)
_FIXED_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED)
# What these drive a gain with stays within the range of the control.
_BOUNDED_BY_CONTROL = tuple(
    int(kind) for kind in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
)
_UNBOUNDED = np.array([-np.inf, np.inf])


def effort(model: mujoco.MjModel, joint: int) -> float:
    """The most that drives ``joint`` either way, N m or, of a slide, N; 0 where nothing bounds it.

    The joint's own limit or that of its actuators together, whichever is less.
    """
    limits = []
    if model.jnt_actfrclimited[joint]:
        limits.append(model.jnt_actfrcrange[joint])
    actuators = np.flatnonzero(on_joints(model) & (model.actuator_trnid[:, 0] == joint))
    geared = [actuator for actuator in actuators.tolist() if model.actuator_gear[actuator, 0] != 0.0]
    if geared:
        limits.append(sum((_joint_range(model, actuator) for actuator in geared), np.zeros(2)))
    least = min((float(np.abs(limit).max()) for limit in limits), default=np.inf)
    return least if np.isfinite(least) else 0.0


def _joint_range(model: mujoco.MjModel, actuator: int) -> np.ndarray:
    """(2,) what the actuator exerts on its joint, least and most: its own force times its gear."""
    low_high = _UNBOUNDED
    if (
        model.actuator_ctrllimited[actuator]
        and model.actuator_gaintype[actuator] == _FIXED_GAIN
        and model.actuator_biastype[actuator] == _NO_BIAS
        and model.actuator_dyntype[actuator] in _BOUNDED_BY_CONTROL
    ):
        low_high = np.sort(model.actuator_ctrlrange[actuator] * model.actuator_gainprm[actuator, 0])
    if model.actuator_forcelimited[actuator]:
        low_high = np.clip(low_high, *model.actuator_forcerange[actuator])
    return np.sort(low_high * model.actuator_gear[actuator, 0])
