"""Free flights: in the free space, as many and as often as rollouts, at any height and gaze."""

import numpy as np
import pytest

from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.rollouts.camera_flight import FreeSpace, camera_flights
from r2sego_blender.robot.rollouts.candidates import candidate_stream
from r2sego_blender.robot.scope.scope import BehaviourScope

OUTLINE = np.array([[-2.0, -1.5], [2.0, -1.5], [2.0, 1.5], [-2.0, 1.5]])
CAPTURES = np.array([[-1.5, 0.0, 1.5], [-1.2, 0.8, 1.4]])


def box(low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[s[0], s[k], s[k + 1]] for s in sides for k in (1, 2)]
    return np.array(low) + corners * (np.array(high) - low), np.array(faces)


def joined(*meshes):
    vertices, faces, count = [], [], 0
    for v, f in meshes:
        vertices.append(v)
        faces.append(f + count)
        count += len(v)
    return np.concatenate(vertices), np.concatenate(faces)


@pytest.fixture(scope="module")
def room():
    """A room of 4 x 3 x 2.5 m with a table; beyond a wall at x = 1.2 a closet nobody entered."""
    return joined(
        box([-2.0, -1.5, 0.0], [2.0, 1.5, 2.5]),
        box([-0.4, -0.3, 0.0], [0.4, 0.3, 0.8]),
        box([1.2, -1.5, 0.0], [1.21, 1.5, 2.5]),
    )


@pytest.fixture(scope="module")
def space(room):
    return FreeSpace(*room, OUTLINE, CAPTURES)


@pytest.fixture(scope="module")
def flights(space):
    return camera_flights(space, BehaviourScope.load("walk_and_look"), 6, seed=3)


def distance_to_box(points, low, high):
    return np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=-1)


def test_the_table_and_what_is_near_it_hide_what_is_behind(space):
    here, beyond = np.array([-1.5, 0.0, 0.5]), np.array([0.9, 0.0, 0.5])
    assert space.is_free(here) and space.is_free(beyond)
    assert not space.sees(here, beyond) and not space.sees(beyond, here)
    for height_m, free in ((1.0, False), (1.1, True)):  # the clearance ends 25 cm above its top
        assert space.sees(np.array([-1.5, 0.0, height_m]), np.array([0.9, 0.0, height_m])) is free
    assert space.sees(here, np.array([-0.9, 0.0, 0.5]))


def test_flights_keep_clear_of_walls_and_table_and_out_of_the_closet(flights):
    places = candidate_stream(flights).poses[:, :3, 3]
    walls = np.minimum(places - [-2.0, -1.5, 0.0], [1.2, 1.5, 2.5] - places)
    assert walls.min() > 0.22
    table = distance_to_box(places, np.array([-0.4, -0.3, 0.0]), np.array([0.4, 0.3, 0.8]))
    assert table.min() > 0.22


def test_they_are_as_many_views_as_rollouts_of_the_scope_give(flights):
    episode = BehaviourScope.load("walk_and_look").episode
    frames = round(episode.duration_s * episode.camera_rate_hz) + 1
    assert len(candidate_stream(flights)) == 6 * frames
    assert all(np.allclose(np.diff(f.times_s), 1.0 / episode.camera_rate_hz) for f in flights)


def test_they_move_as_fast_as_the_scope_walks(flights):
    scope = BehaviourScope.load("walk_and_look")
    for flight in flights:
        steps = np.linalg.norm(np.diff(flight.camera_poses[:, :3, 3], axis=0), axis=1)
        speed = np.median(steps) * scope.episode.camera_rate_hz
        assert scope.walk_to.speed_m_s[0] - 1e-6 <= speed <= scope.walk_to.speed_m_s[1] + 1e-6


def test_no_body_limits_height_and_gaze(space):
    flights = camera_flights(space, BehaviourScope.load("walk_and_look"), 20, seed=0)
    poses = candidate_stream(flights).poses
    assert poses[:, 2, 3].min() < 0.6 and poses[:, 2, 3].max() > 1.9
    assert poses[:, 2, 2].max() > 0.1 and poses[:, 2, 2].min() < -0.7
    np.testing.assert_allclose(poses[:, 2, 0], 0.0, atol=1e-9)  # level: the image's rows lie flat
    rotations = poses[:, :3, :3]
    np.testing.assert_allclose(
        rotations.transpose(0, 2, 1) @ rotations, np.broadcast_to(np.eye(3), rotations.shape), atol=1e-12
    )
    assert (np.linalg.det(rotations) > 0.0).all()
    for flight in flights:
        height_m, down = flight.camera_poses[:, 2, 3], -flight.camera_poses[:, 2, 2]
        assert flight.quality.camera_height_m == (height_m.min(), height_m.max())
        down_deg = np.degrees(np.arcsin([down.min(), down.max()]))
        np.testing.assert_allclose(flight.quality.camera_pitch_deg, down_deg, atol=1e-9)


def test_the_same_seed_flies_the_same(space, flights):
    again = camera_flights(space, BehaviourScope.load("walk_and_look"), 6, seed=3)
    other = camera_flights(space, BehaviourScope.load("walk_and_look"), 6, seed=4)
    for a, b, c in zip(flights, again, other, strict=True):
        np.testing.assert_array_equal(a.camera_poses, b.camera_poses)
        assert not np.array_equal(a.camera_poses, c.camera_poses)


def test_a_room_without_space_is_told():
    vertices, faces = box([-0.2, -0.2, 0.0], [0.2, 0.2, 0.4])
    with pytest.raises(RobotError, match="no free space"):
        FreeSpace(vertices, faces, 0.1 * OUTLINE, np.zeros((1, 3)))


def test_a_region_may_be_a_polygon_of_any_shape(room):
    l_shape = np.array([[-2, -1.5], [-2, 1.5], [-1, 1.5], [-1, -0.7], [1, -0.7], [1, -1.5]], float)
    places = FreeSpace(*room, l_shape, CAPTURES[:1]).points
    assert ((places[:, 0] < -1.0) | (places[:, 1] < -0.7)).all()
    assert (places[:, 0] < -1.0).any() and (places[:, 0] > 0.5).any()
