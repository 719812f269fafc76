"""Tracks of points in a room, as cameras on an arc measure them, for tests of poses and lenses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2sego_blender.captures.lenses.lens import Lens
from r2sego_blender.core.cameras import Camera, look_at

LENS = Camera(640, 480, 400.0, 400.0, 320.0, 240.0, np.eye(4))


def arc(count: int, lens: Camera = LENS) -> list[Camera]:
    """Cameras around the room's middle, at eye height, looking inwards."""
    angles = np.linspace(-0.8, 0.8, count)
    places = [(3 * np.sin(a), -3 * np.cos(a), 1.5 + 0.1 * np.cos(5 * a)) for a in angles]
    return [lens.at(look_at(place, (0.2, 0.4, 0.9))) for place in places]


def measured(
    cameras: Sequence[Camera],
    rng: np.random.Generator,
    count: int = 500,
    noise_px: float = 0.2,
    distortion: tuple[float, ...] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) and where the cameras saw them (P, N, 2), NaN elsewhere; each is seen by two at least."""
    points = rng.uniform((-2, -1, 0), (2, 3, 2.6), (count, 3))
    pixels = np.full((count, len(cameras), 2), np.nan)
    for index, camera in enumerate(cameras):
        lens = Lens(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, distortion)
        local = points @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
        places = lens.project(local[:, :2] / local[:, 2:])
        seen = camera.sees(places, local[:, 2]) & (rng.random(count) < 0.6)
        pixels[seen, index] = places[seen] + rng.normal(0, noise_px, (seen.sum(), 2))
    kept = np.isfinite(pixels[..., 0]).sum(axis=1) >= 2
    return points[kept], pixels[kept]
