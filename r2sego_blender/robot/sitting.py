"""The seated posture: how low the base comes to rest on a seat."""

from __future__ import annotations

import numpy as np

from .collision_shapes import colliding, core_points
from .kinematics import LegSolver
from .model import RobotModel
from .seats import Seat
from .structure import posed

_ITERATIONS = 8
_TOLERANCE_M = 5e-4
# References press this far into the seat, so that it carries the weight.
_PRESS_M = 0.006
_ALONG = np.linspace(0.0, 1.0, 9)[:, None]


def seated_height(robot: RobotModel, qpos: np.ndarray, soles: np.ndarray, seat: Seat) -> float:
    """World z of the base that sits on ``seat``, metres.

    ``qpos`` (nq,) is the posture with the base's place and heading on the seat; ``soles``
    (L, 4) where the feet stay, as ``LegSolver.solve`` takes them. What may touch the seat is
    the base and the legs above the feet.
    """
    model, solver = robot.model, LegSolver(robot)
    above = {int(model.jnt_bodyid[joint]) for leg in robot.legs for joint in leg.joints}
    above = (above | {robot.base}) - {leg.foot for leg in robot.legs}
    geoms = [geom for geom in colliding(model) if int(model.geom_bodyid[geom]) in above]
    ahead = np.array([np.cos(seat.yaw_rad), np.sin(seat.yaw_rad)])
    posture = qpos[None].copy()
    posture[0, 2] = seat.height_m + 0.15
    for _ in range(_ITERATIONS):
        solver.solve(posture, soles[:, None])
        data = posed(model, posture[0])
        bottom_m = np.inf
        for geom in geoms:
            points, radius_m = core_points(model, data, geom)
            if len(points) == 2:  # a capsule's ends: what lies between them matters
                points = points[0] + _ALONG * (points[1] - points[0])
            over = (points[:, :2] - seat.edge_m) @ ahead <= 0.0
            bottom_m = min(bottom_m, points[over, 2].min(initial=np.inf) - radius_m)
        missing_m = seat.height_m - _PRESS_M - bottom_m
        if not np.isfinite(missing_m) or abs(missing_m) < _TOLERANCE_M:
            break
        posture[0, 2] += missing_m
    return float(posture[0, 2])
