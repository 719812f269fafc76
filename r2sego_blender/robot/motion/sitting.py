"""The seated posture: how low the base comes to rest on a seat, asked of MuJoCo's collisions."""

from __future__ import annotations

import mujoco
import numpy as np

from ..behaviours.trajectory import Seat
from ..model.composition import Composition
from ..model.contacts import scene_contacts
from ..model.kinematics import LegSolver
from ..model.model import RobotModel

# References press this far into the seat, so that it carries the weight.
_PRESS_M = 0.006
_TOLERANCE_M = 1e-3
# Feet that would have to leave their place by more are out of reach.
_REACH_M = 0.005
# The base is looked for from here above the seat, downwards.
_LOWEST_M = 0.02


def seated_height(
    robot: RobotModel, composition: Composition, qpos: np.ndarray, soles: np.ndarray, seat: Seat
) -> float | None:
    """World z of the base that sits on ``seat``, metres; None where the legs are too short for it.

    ``qpos`` (nq,) is the standing posture with the base's place and heading on the seat;
    ``soles`` (L, 4) where the feet stay, as ``LegSolver.solve`` takes them. The deeper a robot
    sits, the steeper its thighs press on the seat's edge, and a short-legged one cannot.
    """
    solver, data = LegSolver(robot), mujoco.MjData(composition.model)
    posture = qpos[None].copy()

    def is_held_at(height_m: float) -> bool:
        posture[0, 2] = height_m
        solver.solve(posture, soles[:, None])
        data.qpos[:] = posture[0]
        mujoco.mj_kinematics(composition.model, data)
        mujoco.mj_collision(composition.model, data)
        touching = scene_contacts(composition, data, with_forces=False)
        on_seat = composition.seat_geoms[touching.robot] & seat.holds(touching.position_m)
        return bool(touching.depth_m[on_seat].max(initial=0.0) > _PRESS_M)

    high_m, low_m = float(qpos[2]), seat.height_m + _LOWEST_M
    if is_held_at(high_m) or not is_held_at(low_m):
        return None
    while high_m - low_m > _TOLERANCE_M:
        middle_m = 0.5 * (high_m + low_m)
        high_m, low_m = (high_m, middle_m) if is_held_at(middle_m) else (middle_m, low_m)
    posture[0, 2] = high_m
    missed_m = solver.solve(posture, soles[:, None])
    return high_m if missed_m.max() < _REACH_M else None
