"""Pixels of a photograph and rays of the world, for picking by mouse and for the overlay. No bpy."""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera


def pixel_of_ray(camera: Camera, direction: np.ndarray) -> tuple[float, float] | None:
    """The pixel that looks in a world direction (3,); None outside the image or behind."""
    local = camera.world_from_camera[:3, :3].T @ np.asarray(direction, np.float64)
    if local[2] <= 0.0:
        return None
    x = camera.fx * local[0] / local[2] + camera.cx
    y = camera.fy * local[1] / local[2] + camera.cy
    return (float(x), float(y)) if 0.0 <= x <= camera.width and 0.0 <= y <= camera.height else None


def points_at(camera: Camera, pixels: np.ndarray, depth_m: float = 1.0) -> np.ndarray:
    """(n, 3) world points at pixels (n, 2) and a planar depth, metres."""
    pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
    local = np.column_stack(
        [(pixels[:, 0] - camera.cx) / camera.fx, (pixels[:, 1] - camera.cy) / camera.fy, np.ones(len(pixels))]
    )
    return depth_m * local @ camera.world_from_camera[:3, :3].T + camera.centre


def next_name(taken: list[str]) -> str:
    """A name for the next picked point: A to Z, then A1, B1 and so on."""
    number = 0
    while True:
        letter, round_ = chr(ord("A") + number % 26), number // 26
        name = letter + (str(round_) if round_ else "")
        if name not in taken:
            return name
        number += 1
