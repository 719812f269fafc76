"""Camera paths end where they must, move one way, and relate to the reference."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, rotation_angle_rad
from r2sego_blender.generation.paths.paths import camera_path, eased, reference_from_frame


def camera(seed: int, width: int = 64) -> Camera:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = rng.normal(size=3)
    return Camera(width, 48, 40.0, 41.0, 32.0, 24.0, pose)


@given(st.integers(0, 1000), st.integers(0, 1000), st.integers(2, 40))
def test_a_path_moves_from_the_reference_to_exactly_the_target(a, b, frames):
    reference, target = camera(a, width=80), camera(b)
    path = camera_path(reference, target, frames)
    assert len(path) == frames
    np.testing.assert_array_equal(path[0].world_from_camera, reference.world_from_camera)
    np.testing.assert_array_equal(path[-1].world_from_camera, target.world_from_camera)
    assert {(c.width, c.fx, c.fy) for c in path} == {(64, 40.0, 41.0)}
    travelled = [np.linalg.norm(c.centre - reference.centre) for c in path]
    turned = [rotation_angle_rad(c.world_from_camera, reference.world_from_camera) for c in path]
    assert (np.diff(travelled) >= -1e-9).all()
    assert (np.diff(turned) >= -1e-6).all()
    whole = np.linalg.norm(target.centre - reference.centre)
    np.testing.assert_allclose(travelled, eased(frames) * whole, atol=1e-9)
    for one in path:
        rotation = one.world_from_camera[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)


@given(st.integers(2, 200))
def test_easing_rises_from_rest_to_rest(frames):
    shares = eased(frames)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert (np.diff(shares) > 0.0).all()
    np.testing.assert_allclose(shares + shares[::-1], 1.0)
    if frames > 3:
        assert shares[1] < 1.0 / (frames - 1)


def test_relative_motions_compose_with_the_reference():
    reference = camera(1)
    path = camera_path(reference, camera(2), 7)
    relative = reference_from_frame(reference, path)
    np.testing.assert_allclose(relative[0], np.eye(4), atol=1e-12)
    for motion, one in zip(relative, path, strict=True):
        np.testing.assert_allclose(reference.world_from_camera @ motion, one.world_from_camera, atol=1e-12)


def test_a_way_is_followed_with_the_same_easing():
    reference, target = camera(1), camera(2)
    middle = np.array([[3.0, 0.0, 1.0], [3.0, 4.0, 1.0]])
    way = np.concatenate([[reference.centre], middle, [target.centre]])
    path, straight = camera_path(reference, target, 9, way), camera_path(reference, target, 9)
    np.testing.assert_array_equal(path[0].world_from_camera, reference.world_from_camera)
    np.testing.assert_array_equal(path[-1].world_from_camera, target.world_from_camera)
    for one, other in zip(path, straight, strict=True):
        np.testing.assert_array_equal(one.world_from_camera[:3, :3], other.world_from_camera[:3, :3])
    lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
    halfway = middle[0] + (lengths.sum() / 2 - lengths[0]) * np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(path[4].centre, halfway)


def test_one_frame_is_no_path():
    with pytest.raises(ValueError, match="two"):
        camera_path(camera(1), camera(2), 1)
