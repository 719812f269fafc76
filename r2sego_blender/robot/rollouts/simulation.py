"""One attempt in simulation: a drive's controls, stepped, measured and judged."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from ..controllers.controller import Drive
from ..model.composition import Composition
from ..model.contacts import scene_contacts
from .failures import SUCCESS, Judge, Reason
from .quality import Meter

_CHECK_S = 0.02


@dataclass(frozen=True)
class Simulated:
    """A simulated attempt: ``qpos`` (T, nq) and ``times_s`` (T,) float64 at the camera's
    rate, up to the failure if any."""

    qpos: np.ndarray
    times_s: np.ndarray
    reason: Reason
    detail: str
    meter: Meter


def simulate(composition: Composition, drive: Drive, judge: Judge, camera_rate_hz: float) -> Simulated:
    """Step ``drive`` until it ends or fails."""
    model = composition.model
    data = mujoco.MjData(model)
    data.qpos[:] = drive.qpos
    step_s = model.opt.timestep
    steps = round(drive.duration_s / step_s)
    frame_steps = 1.0 / (camera_rate_hz * step_s)
    check_steps = max(1, round(_CHECK_S / step_s))
    meter = Meter(composition, drive.seat, check_steps * step_s)
    qpos: list[np.ndarray] = []
    times: list[float] = []
    reason, detail = SUCCESS
    for step in range(steps + 1):
        if step >= len(qpos) * frame_steps - 1e-9:
            qpos.append(data.qpos.copy())
            times.append(step * step_s)
        if step >= round(drive.duration_s / step_s):
            break
        drive.apply(data, step)
        mujoco.mj_step(model, data)
        if step % check_steps == 0:
            contacts = scene_contacts(composition, data)
            meter.read(data, contacts)
            reason, detail = judge.state(data, contacts, drive.seat, meter)
            if reason:
                break
    if reason is Reason.NON_FINITE:  # since the last look the state may be anything
        known = np.searchsorted(times, (step - check_steps + 1) * step_s, side="right")
        qpos, times = qpos[: max(1, known)], times[: max(1, known)]
    if not reason:
        reason, detail = judge.end(data, drive.goal, drive.seat, meter)
    return Simulated(np.array(qpos), np.array(times), reason, detail, meter)
