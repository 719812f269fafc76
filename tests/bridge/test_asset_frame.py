"""Where pictures are compared in a view."""

import numpy as np
import pytest

pytest.importorskip("bpy", reason="pip bpy is not installed")

from r2sego_blender.bridge.asset.asset_cameras import view_camera
from r2sego_blender.bridge.asset.asset_frame import frame_px


def test_a_frame_is_where_its_corners_are_seen():
    corners = np.array([[x, y, -2.0, 1.0] for x in (-1.0, 1.0) for y in (-0.5, 0.5)])
    perspective = np.array([[1.5, 0, 0.1, 0], [0, 2.0, 0, 0], [0, 0, -1.0, -0.2], [0, 0, -1.0, 0]])
    left, bottom, width, height = frame_px(corners, perspective, 400, 300)
    # x: (1.5 * +-1 + 0.1 * -2) / 2 = -0.85 and 0.65 of the half width, y: +-0.5 of the half height.
    assert (left, bottom, width, height) == pytest.approx((30.0, 75.0, 300.0, 150.0))


def test_a_views_camera_projects_as_its_matrices_do():
    rng = np.random.default_rng(2)
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = np.linalg.qr(rng.normal(size=(3, 3)))[0], (0.1, 0.2, -6.0)
    view[:3, :3] *= np.sign(np.linalg.det(view[:3, :3]))
    points = np.concatenate([rng.uniform(-1, 1, (20, 3)), np.ones((20, 1))], axis=1)
    perspective = np.array([[1.8, 0, 0.2, 0], [0, 2.4, -0.1, 0], [0, 0, -1.0, -0.2], [0, 0, -1.0, 0]])
    parallel = np.array([[0.3, 0, 0, 0.2], [0, 0.4, 0, -0.1], [0, 0, -0.01, 0], [0, 0, 0, 1.0]])
    for window, is_parallel in ((perspective, False), (parallel, True)):
        clip = points @ (window @ view).T
        at = (clip[:, :2] / clip[:, 3:] + 1.0) / 2.0 * (400, 300)
        camera, found = view_camera(view, window, 400, 300)
        assert found == is_parallel
        local = points @ camera.camera_from_world.T
        depth = np.ones(20) if found else local[:, 2]
        u = local[:, 0] / depth * camera.fx + camera.cx
        v = local[:, 1] / depth * camera.fy + camera.cy
        np.testing.assert_allclose(np.stack([u, 300 - v], axis=1), at, atol=1e-9)
