"""The trajectory that a behaviour is drawn as: of the base, and of what the body does besides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RATE_HZ = 50.0
"""Rate of reference motions."""

STEP_SPEED_M_S = 0.22
"""Mean speed of small steps, which start and end at rest."""

STILL_S = 0.4
"""Standing before a squat and before sitting down."""

REACH_RAD = 0.8
"""How far the arms are lifted forward, for balance."""


STAND_OFF_M = 0.14
"""From the seat's front edge to the pelvis that stands before it, about to sit down."""

# What touches the robot this near to a seat's edge, and no higher above it, carries the seated body.
_HOLDS_M, _HOLDS_ABOVE_M = 0.45, 0.08


@dataclass(frozen=True)
class Seat:
    """A place to sit, looking along ``yaw_rad``, away from the backrest where there is one.

    ``edge_m`` (2,) is the point of the front edge in the middle before the seated robot,
    world x and y, metres; ``height_m`` the world z of the surface; ``approach_m`` how far
    before the edge the free floor begins, where a robot can turn; ``surface`` numbers the
    surfaces: a sofa is one, with many places.
    """

    edge_m: tuple[float, float]
    height_m: float
    yaw_rad: float
    approach_m: float
    surface: int = 0

    def ahead(self, distance_m: float) -> np.ndarray:
        """(2,) the point ``distance_m`` before the front edge; negative: on the seat."""
        return np.array(self.edge_m) + distance_m * np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)])

    def holds(self, points: np.ndarray) -> np.ndarray:
        """(n,) bool: which contact points (n, 3) belong to sitting here."""
        near = np.linalg.norm(points[:, :2] - self.ahead(-0.1), axis=1) < _HOLDS_M
        return near & (points[:, 2] < self.height_m + _HOLDS_ABOVE_M)

    def is_near(self, point: np.ndarray) -> bool:
        """Whether (2,) is on the seat or on the last step towards it."""
        return bool(np.linalg.norm(np.asarray(point) - self.edge_m) < self.approach_m + 0.1)


@dataclass(frozen=True)
class Pursuit:
    """A way as it is walked, at ``RATE_HZ``.

    ``xy`` (T, 2) metres, ``yaw`` (T,) radians, not wrapped, ``speed`` (T,) m/s along the
    heading; ``arrived`` is the first frame at which the goal and the final heading are
    reached, None where time does not suffice.
    """

    xy: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    arrived: int | None


@dataclass(frozen=True)
class RootTrajectory:
    """The base's reference on the floor at ``RATE_HZ``, and what the body does besides.

    ``xy`` (T, 2) metres, ``yaw`` (T,) radians, not wrapped, ``speed`` (T,) m/s: where the
    robot stands and walks. ``crouch`` (T,) is the lowering, as a share of the standing
    height; ``lean`` and ``reach`` (T,) radians of the waist and of the arms, forward; ``sit``
    (T,) from 0, standing, to 1, on the ``seat``, ``depth_m`` behind its front edge. ``goal``
    (2,) is where the base has to end.
    """

    behaviour: str
    xy: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray
    goal: np.ndarray
    crouch: np.ndarray
    lean: np.ndarray
    reach: np.ndarray
    sit: np.ndarray
    seat: Seat | None = None
    depth_m: float = 0.0

    @staticmethod
    def upright(behaviour: str, xy: np.ndarray, yaw: np.ndarray, speed: np.ndarray, goal: np.ndarray) -> RootTrajectory:
        """One whose body does nothing besides."""
        nothing = np.zeros(len(yaw))
        return RootTrajectory(behaviour, xy, yaw, speed, goal, nothing, nothing, nothing, nothing)


def eased(phase: np.ndarray) -> np.ndarray:
    """0 to 1 over ``phase`` 0 to 1, at rest at both ends; its greatest slope is 1.875."""
    phase = np.clip(phase, 0.0, 1.0)
    return phase**3 * (10.0 - 15.0 * phase + 6.0 * phase**2)


def times(duration_s: float) -> np.ndarray:
    """(T,) seconds of a trajectory's frames."""
    return np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ
