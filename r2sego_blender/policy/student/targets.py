"""What a student is given, and what its auxiliary heads learn: where the seat is, and where it stands itself.

Needs NumPy alone.
"""

from __future__ import annotations

import math

import numpy as np

from ..environment.state import PrivilegedState

PICTURE_SHAPE = (96, 128, 3)
"""Rows, columns and sRGB channels of a head image, uint8."""

SEAT_TARGETS = 6
"""Distance in metres, sine and cosine of bearing and of heading, and whether the head looks that way."""

POSE_SIZE = 3
"""A base's place in the world frame, metres, and its heading in radians."""

_HALF_VIEW_RAD = math.radians(45.0)
_NEAREST_M = 0.4  # what is nearer lies below the picture


def seat_target(state: PrivilegedState) -> np.ndarray:
    """(SEAT_TARGETS,) float32 of the seat, or of the goal, whose heading is 0; nan where there is neither.

    Bearing and heading are in the base's frame, positive to the left. Furniture that hides the seat is not asked for.
    """
    if state.seat is not None:
        place, heading = np.array(state.seat.edge_m), state.seat.yaw_rad - state.yaw_rad
    elif state.goal_xy_m is not None:
        place, heading = state.goal_xy_m, 0.0
    else:
        return np.full(SEAT_TARGETS, np.nan, np.float32)
    offset = place - state.base_xy_m
    distance_m = float(np.hypot(*offset))
    bearing = math.remainder(math.atan2(offset[1], offset[0]) - state.yaw_rad, math.tau)
    in_view = abs(bearing) < _HALF_VIEW_RAD and distance_m > _NEAREST_M
    angles = (math.sin(bearing), math.cos(bearing), math.sin(heading), math.cos(heading))
    return np.array([distance_m, *angles, in_view], np.float32)


def pose_of(state: PrivilegedState) -> np.ndarray:
    """(POSE_SIZE,) float32 of the base."""
    return np.array([*state.base_xy_m, state.yaw_rad], np.float32)
