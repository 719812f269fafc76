"""Agreement of depth maps, beside its definition."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.stereo.consistency import agreement, support

CAMERA = Camera(40, 30, 33.0, 35.0, 19.3, 15.8, look_at([0.3, -2.0, 1.2], [0.0, 0.5, 1.0]))
TOLERANCE = 0.02


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def agrees(point, camera, depth, normal, tolerance, point_normal) -> bool:
    """Whether a point lies on the plane of the pixel that shows it, along the camera's ray to it."""
    x, y, z = camera.camera_from_world[:3, :3] @ point + camera.camera_from_world[:3, 3]
    if z < 1e-3:
        return False
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    if not (0 <= u < camera.width and 0 <= v < camera.height) or depth[int(v), int(u)] <= 0:
        return False
    pixel = int(v), int(u)
    if point_normal is not None and point_normal @ normal[pixel] < 0.7:
        return False
    to_pixel = np.array([(int(u) + 0.5 - camera.cx) / camera.fx, (int(v) + 0.5 - camera.cy) / camera.fy, 1.0])
    across = camera.camera_from_world[:3, :3] @ normal[pixel]
    to_point = np.array([x / z, y / z, 1.0])
    seen = depth[pixel]
    if abs(across @ to_point) > 1e-2:
        seen = seen * (across @ to_pixel) / (across @ to_point)
    return abs(seen - z) < tolerance * z


@pytest.mark.parametrize("with_normals", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_agreement_is_its_plain_reference(seed, with_normals):
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random(CAMERA.shape) < 0.2, 0.0, rng.uniform(1.0, 3.0, CAMERA.shape)).astype(np.float32)
    toward = -unit(CAMERA.rays() @ CAMERA.world_from_camera[:3, :3].T)
    normal = unit(toward + rng.normal(0.0, 0.5, toward.shape)).astype(np.float32)
    # Points around what the map shows, some of them outside of the picture or behind the camera.
    pixels = rng.uniform(-5, 45, (3000, 2))
    row, column = (np.clip(pixels[:, k].astype(int), 0, CAMERA.shape[k] - 1) for k in (0, 1))
    rays = np.column_stack([(pixels[:, ::-1] - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones(3000)])
    z = depth[row, column] * rng.normal(1.0, 0.02, 3000) * np.where(rng.random(3000) < 0.05, -1.0, 1.0)
    points = (rays * z[:, None]) @ CAMERA.world_from_camera[:3, :3].T + CAMERA.centre
    normals = unit(normal[row, column] + rng.normal(0.0, 0.5, (3000, 3))) if with_normals else None
    found = agreement(points, CAMERA, depth, normal, TOLERANCE, normals)
    expected = [
        agrees(point, CAMERA, depth, normal, TOLERANCE, None if normals is None else normals[index])
        for index, point in enumerate(points)
    ]
    assert 0.1 < np.mean(expected) < 0.9
    assert np.mean(found == expected) > 0.999  # float32 at the very border


def test_support_counts_the_others_that_see_the_same_wall():
    """Of three captures of the wall y = 1 one has it 10 % too far; what is not usable counts nowhere."""
    cameras = [CAMERA.at(look_at([x, -2.0, 1.2], [x, 1.0, 1.2])) for x in (0.0, 0.1, 0.2)]
    depths = [np.full(CAMERA.shape, wall, np.float32) for wall in (3.0, 3.0, 3.3)]
    normals = [np.full((*CAMERA.shape, 3), [0.0, -1.0, 0.0], np.float32) for _ in cameras]
    usable = [np.ones(CAMERA.shape, bool) for _ in cameras]
    usable[0][:, :10] = False
    first, second, third = support(cameras, depths, normals, usable, TOLERANCE)
    assert not first[:, :10].any() and not third.any()
    assert (first[:, 12:-4] == 1).all()
    assert (second[:, 12:-4] == 1).all() and (second[:, :7] == 0).all()
