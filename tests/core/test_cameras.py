"""Cameras: projections and transforms that undo each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, NotRigidError, is_rigid, is_similarity, look_at, rotation_angle_rad

finite = st.floats(-5.0, 5.0)


@st.composite
def cameras(draw) -> Camera:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    pose[:3, 3] = rng.uniform(-5, 5, 3)
    width, height = int(rng.integers(8, 80)), int(rng.integers(8, 80))
    fx, fy = rng.uniform(20, 200, 2)
    return Camera(width, height, fx, fy, width * rng.uniform(0.3, 0.7), height * rng.uniform(0.3, 0.7), pose)


@given(cameras())
def test_projecting_an_unprojected_depth_map_returns_pixel_centres(camera):
    depth = np.random.default_rng(0).uniform(0.5, 5.0, camera.shape)
    pixels, z = camera.project(camera.unproject(depth))
    v, u = np.indices(camera.shape) + 0.5
    np.testing.assert_allclose(pixels, np.stack([u, v], -1), atol=1e-7)
    np.testing.assert_allclose(z, depth, rtol=1e-9)
    assert camera.sees(pixels, z).all()


@given(cameras(), st.floats(0.3, 3.0))
def test_scaling_keeps_the_field_of_view(camera, factor):
    scaled = camera.scaled(factor)
    corner = np.array([camera.width, camera.height]) * [1.0, 1.0]
    ray = (corner - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    scaled_ray = (np.array([scaled.width, scaled.height]) - [scaled.cx, scaled.cy]) / [scaled.fx, scaled.fy]
    np.testing.assert_allclose(ray, scaled_ray, atol=1e-9)


@given(cameras(), st.floats(0.1, 10.0))
def test_a_similarity_moves_camera_and_points_alike(camera, scale):
    similarity = np.eye(4)
    similarity[:3, :3] = scale * Rotation.random(random_state=1).as_matrix()
    similarity[:3, 3] = [1.0, -2.0, 0.5]
    points = camera.unproject(np.full(camera.shape, 2.0))
    moved = points @ similarity[:3, :3].T + similarity[:3, 3]
    pixels, depth = camera.project(points)
    moved_pixels, moved_depth = camera.transformed(similarity).project(moved)
    np.testing.assert_allclose(moved_pixels, pixels, atol=1e-6)
    np.testing.assert_allclose(moved_depth, depth * scale, rtol=1e-9)


@given(cameras())
def test_json_round_trip_is_exact(camera):
    again = Camera.from_json(camera.to_json())
    assert again.to_json() == camera.to_json()
    np.testing.assert_allclose(again.camera_from_world @ again.world_from_camera, np.eye(4), atol=1e-12)


def test_look_at_is_upright_and_faces_its_target():
    pose = look_at([1.0, 2.0, 1.5], [4.0, 2.0, 0.5])
    camera = Camera(64, 48, 50, 50, 32, 24, pose)
    pixels, depth = camera.project(np.array([4.0, 2.0, 0.5]))
    np.testing.assert_allclose(pixels, [32, 24], atol=1e-9)
    assert depth > 0 and pose[2, 1] < 0 and abs(pose[2, 0]) < 1e-12
    assert rotation_angle_rad(pose, pose) == pytest.approx(0.0, abs=1e-7)


def test_a_camera_sees_what_is_in_front_within_its_image_less_the_margin():
    camera = Camera(64, 48, 50.0, 50.0, 32.0, 24.0, np.eye(4))
    pixels = np.array([[0.0, 0.0], [63.9, 47.9], [64.0, 20.0], [20.0, 48.0], [-0.1, 20.0], [20.0, -0.1]])
    assert camera.sees(pixels, np.ones(6)).tolist() == [True, True, False, False, False, False]
    assert not camera.sees(pixels, np.zeros(6)).any() and not camera.sees(pixels, -np.ones(6)).any()
    within = np.array([[3.0, 3.0], [60.9, 44.9], [61.0, 20.0], [20.0, 45.0], [2.9, 20.0], [20.0, 2.9]])
    assert camera.sees(within, np.ones(6), margin_px=3.0).tolist() == [True, True, *[False] * 4]


@given(cameras())
def test_the_intrinsic_matrix_projects(camera):
    point = np.array([0.3, -0.2, 1.7])
    u, v, w = camera.matrix @ point
    pixels, depth = camera.at(np.eye(4)).project(point)
    np.testing.assert_allclose([u / w, v / w, w], [*pixels, depth])


def test_a_rigid_pose_turns_and_moves_and_does_nothing_else():
    pose = look_at([1.0, 2.0, 1.5], [4.0, 2.0, 0.5])
    assert is_rigid(pose)
    not_finite, last_row = pose.copy(), pose.copy()
    not_finite[0, 3], last_row[3, 0] = np.inf, 1e-3
    mirrored, stretched = pose @ np.diag([-1.0, 1.0, 1.0, 1.0]), pose @ np.diag([1.01, 1.01, 1.01, 1.0])
    assert not any(map(is_rigid, (not_finite, last_row, mirrored, stretched)))


def test_a_camera_keeps_a_pose_of_its_own():
    pose = np.eye(4, dtype=np.float32)
    camera = Camera(4, 4, 1, 1, 2, 2, pose)
    pose[0, 3] = 5.0
    assert camera.centre[0] == 0.0 and camera.world_from_camera.dtype == np.float64


def test_a_pose_that_is_not_finite_is_refused():
    with pytest.raises(ValueError):
        Camera(4, 4, 1, 1, 2, 2, np.full((4, 4), np.nan))


@pytest.mark.parametrize(
    "wrong", [{"width": 0}, {"height": -7}, {"fx": 0.0}, {"fy": float("nan")}, {"cx": float("inf")}]
)
def test_a_camera_file_that_can_see_nothing_is_refused(wrong):
    told = Camera(4, 4, 1, 1, 2, 2, np.eye(4)).to_json()
    with pytest.raises(ValueError, match="a camera has no"):
        Camera.from_json(told | wrong)


@given(
    st.floats(1e-6, 1e6),
    st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1),
)
def test_a_similarity_is_one_whatever_its_scale_and_a_shear_is_none(scale, offset, quaternion):
    similarity = np.eye(4)
    similarity[:3, :3] = scale * Rotation.from_quat(quaternion).as_matrix()
    similarity[:3, 3] = offset
    assert is_similarity(similarity)
    for wrong in (np.diag([1.0, 1.0, 1.2, 1.0]), np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([0.0, 0.0, 0.0, 1.0])):
        assert not is_similarity(similarity @ wrong)
    similarity[2, 3] = np.nan
    assert not is_similarity(similarity)


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e308, -1e308])
@pytest.mark.parametrize("place", [(0, 0), (1, 3), (3, 1), (3, 3)])
def test_no_number_beyond_all_bounds_is_rigid(number, place):
    """Nothing is multiplied that would overflow, so nothing is warned of."""
    pose = np.eye(4)
    pose[place] = number
    with np.errstate(all="raise"):
        assert not is_rigid(pose)
        assert not is_rigid(np.stack([np.eye(4), pose]))
    assert is_rigid(np.stack([np.eye(4), look_at([1.0, 2.0, 1.5], [4.0, 2.0, 0.5])]))


@pytest.mark.parametrize(
    "wrong", [{"width": 65_536}, {"width": 20_000, "height": 20_000}, {"fx": 1e300}, {"cy": -1e300}, {"height": 1e300}]
)
def test_a_camera_file_beyond_what_any_camera_has_is_refused(wrong):
    told = Camera(4, 4, 1, 1, 2, 2, np.eye(4)).to_json()
    with pytest.raises(ValueError, match="a camera has no"):
        Camera.from_json(told | wrong)


def test_a_camera_file_whose_pose_is_not_rigid_is_refused():
    told = Camera(4, 4, 1, 1, 2, 2, np.eye(4)).to_json()
    with pytest.raises(NotRigidError):
        Camera.from_json(told | {"world_from_camera": np.diag([1.0, 1.0, 1.01, 1.0]).tolist()})
