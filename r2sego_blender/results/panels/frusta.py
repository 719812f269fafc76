"""Camera frusta as triangles. No bpy."""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera

FACES_PER_FRUSTUM, VERTICES_PER_FRUSTUM = 4, 5
_SIDES = np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4]], np.int32)


def frustum_triangles(camera: Camera, poses: np.ndarray, depth_m: float) -> tuple[np.ndarray, np.ndarray]:
    """One open pyramid a pose, from the optical centre to the image at ``depth_m``.

    ``poses`` is (M, 4, 4) ``world_from_camera``. Returns vertices (5 M, 3) float32 (the
    centre, then the corners from the top left clockwise) and triangles (4 M, 3) int32.
    """
    right, bottom = camera.width, camera.height
    pixels = np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]], np.float64)
    local = np.zeros((VERTICES_PER_FRUSTUM, 3))
    local[1:, 0] = (pixels[:, 0] - camera.cx) / camera.fx
    local[1:, 1] = (pixels[:, 1] - camera.cy) / camera.fy
    local[1:, 2] = 1.0
    local *= depth_m
    vertices = np.einsum("mij,vj->mvi", poses[:, :3, :3], local) + poses[:, None, :3, 3]
    triangles = _SIDES[None] + VERTICES_PER_FRUSTUM * np.arange(len(poses), dtype=np.int32)[:, None, None]
    return vertices.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3).astype(np.int32)


def face_steps(values: np.ndarray, best: float, steps: int) -> np.ndarray:
    """(F,) int32: each face's place on a ramp of ``steps`` colours from 0 to ``best``."""
    return np.clip(values / best * steps, 0, steps - 1).astype(np.int32)
