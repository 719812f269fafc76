"""The level camera that furniture is looked for in."""

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, is_rigid, look_at
from r2sego_blender.geometry.layout.furniture import upright

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
UP = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    "pose", [look_at((0.3, -0.2, 1.4), (2.0, 1.0, 0.9)), DOWN, UP, look_at((0, 0, 2), (0, 1e-4, 0))]
)
def test_it_is_level_and_shows_the_same(pose):
    camera = Camera(160, 120, 110.0, 120.0, 75.0, 64.0, pose)
    level, onto = upright(camera)
    assert is_rigid(level.world_from_camera) and abs(level.forward[2]) < 1e-9
    row = 110 if pose[2, 2] > 0.9 else 10  # where the level one looks, too
    pixels = np.array([[40.5, row], [90.0, row + 3.5]])
    seen = camera.unproject(np.full(camera.shape, 2.0))[row : row + 4 : 3, [40, 90]].diagonal().T
    np.testing.assert_allclose(camera.project(seen)[0], np.floor(pixels) + 0.5, atol=1e-9)
    across = np.column_stack([np.floor(pixels) + 0.5, np.ones(2)]) @ onto.T
    there, ahead = level.project(seen)
    assert (ahead > 0.0).all()
    np.testing.assert_allclose(across[:, :2] / across[:, 2:], there, rtol=1e-6)
