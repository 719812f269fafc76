"""Cameras before a wall, of which what they see can be counted by hand."""

from __future__ import annotations

import numpy as np

from r2sego_blender.core.cameras import Camera, look_at

WALL_M = 2.0


def camera(x: float, width: int = 40) -> Camera:
    """At ``x`` before the wall y = 2, looking at it: a picture is 2 m wide and 1 m high on it."""
    return Camera(width, 20, 40.0, 40.0, width / 2, 10.0, look_at(np.array([x, 0.0, 1.0]), np.array([x, WALL_M, 1.0])))


def wall(one: Camera) -> np.ndarray:
    return np.full(one.shape, WALL_M, np.float32)
