"""Room planes from noisy points, and the envelope they form."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.config.settings import ProxySettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.room.planes import RoomPlanes, _bounding, find_planes

SETTINGS = ProxySettings()


def observed(points, normals):
    return SimpleNamespace(points=points.astype(np.float32), normals=normals.astype(np.float32))


def found(room, observed_points, seed=0, **kwargs):
    cameras = tuple(capture.camera for capture in room.captures)
    data = observed(*observed_points(**kwargs))
    return find_planes(data, cameras, SETTINGS, np.random.default_rng(seed))


def matching(planes, normal, offset):
    close = (planes.normals @ normal > np.cos(np.radians(0.5))) & (np.abs(planes.offsets - offset) < 0.006)
    return np.flatnonzero(close)


def test_the_rooms_planes_are_found_through_noise_and_outliers(room, observed_points):
    planes = found(room, observed_points, noise_m=0.004, outliers=800)
    for normal, offset, bounds in (
        ((0, 0, 1), 0.0, True),
        ((0, -1, 0), -1.5, True),
        ((1, 0, 0), -2.0, True),
        ((-1, 0, 0), -2.0, True),
        ((0, 0, 1), 0.7, False),
        ((0, -1, 0), 0.5 * -1, False),
    ):
        index = matching(planes, np.array(normal, float), offset)
        assert len(index) == 1, (normal, offset)
        assert planes.bounding[index[0]] == bounds


def test_an_unseen_wall_is_not_invented(room, observed_points):
    envelope = found(room, observed_points, noise_m=0.004).envelope
    assert not (envelope.normals[:, 1] > 0.5).any()  # the wall behind the captures
    assert envelope.signed_distance(np.array([0.0, -40.0, 1.0])) > 0.9


def test_what_hangs_on_a_wall_does_not_bound_the_room(room, observed_points):
    points, normals = observed_points(noise_m=0.002)
    rng = np.random.default_rng(0)
    picture = np.column_stack([rng.uniform(-1, 0, 4000), np.full(4000, 1.44), rng.uniform(1.2, 2.0, 4000)])
    points = np.concatenate([points, picture])
    normals = np.concatenate([normals, np.tile([0.0, -1.0, 0.0], (4000, 1))])
    cameras = tuple(capture.camera for capture in room.captures)
    planes = find_planes(observed(points, normals), cameras, SETTINGS, np.random.default_rng(0))
    assert len(matching(planes, np.array([0.0, -1, 0]), -1.44)) == 1
    walls = planes.envelope.normals[:, 1] < -0.9
    np.testing.assert_allclose(planes.envelope.offsets[walls], [-1.5], atol=0.01)


def test_of_bounds_on_both_sides_of_one_the_outermost_stays():
    """The first, in the middle, gives way to the outer; the inner is then no twin of any that is left."""
    planes = RoomPlanes(
        np.array([[0.0, 0, 1], [0, -1, 0], [0, -1, 0], [0, -1, 0]]),
        np.array([0.0, -1.5, -1.6, -1.4]),
        np.array([900, 100, 100, 100]),
        np.zeros(4, bool),
    )
    points = np.random.default_rng(0).uniform((-1, -1, 0.1), (1, 1, 2), (1000, 3))
    found = _bounding(planes, points, np.array([[0.0, -1.0, 1.5]]), SETTINGS)
    np.testing.assert_array_equal(found, [True, False, True, False])


def test_walls_are_exactly_upright_and_floors_exactly_level(room, observed_points):
    planes = found(room, observed_points, noise_m=0.01)
    tilt = np.abs(planes.normals[:, 2])
    assert ((tilt == 0) | (tilt == 1)).all()


def test_the_same_seed_gives_the_same_planes(room, observed_points):
    a, b = (found(room, observed_points, noise_m=0.01, outliers=300) for _ in range(2))
    for name in a.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_without_points_only_the_floor_is_known(room):
    cameras = tuple(capture.camera for capture in room.captures)
    nothing = observed(np.zeros((0, 3)), np.zeros((0, 3)))
    planes = find_planes(nothing, cameras, SETTINGS, np.random.default_rng(0))
    np.testing.assert_array_equal(planes.normals, [[0, 0, 1]])
    assert planes.bounding.all()


def test_no_planes_but_the_floor_when_none_are_wanted(room, observed_points):
    cameras = tuple(capture.camera for capture in room.captures)
    none = dataclasses.replace(SETTINGS, planes=0)
    data = observed(*observed_points())
    assert len(find_planes(data, cameras, none, np.random.default_rng(0)).offsets) == 1


def walls(*places_m, counts):
    """Points on walls x = place that face the origin, and a camera there."""
    rng = np.random.default_rng(0)
    points = [
        np.column_stack([np.full(n, x), rng.uniform(-1, 1, n), rng.uniform(0.5, 2, n)])
        for x, n in zip(places_m, counts, strict=True)
    ]
    normals = [np.tile([-np.sign(x), 0.0, 0.0], (n, 1)) for x, n in zip(places_m, counts, strict=True)]
    camera = Camera(8, 6, 5.0, 5.0, 4.0, 3.0, look_at((0, 0, 1.5), (1, 0, 1.5)))
    return observed(np.concatenate(points), np.concatenate(normals)), (camera,)


@pytest.mark.parametrize(("share", "places"), [(0.05, [-1.0, 0.0, 2.0]), (0.15, [0.0, 2.0]), (0.95, [0.0])])
def test_a_plane_holds_its_share_of_the_points(share, places):
    data, cameras = walls(2.0, -1.0, counts=(900, 100))
    chosen = dataclasses.replace(SETTINGS, plane_share=share)
    planes = find_planes(data, cameras, chosen, np.random.default_rng(0))
    np.testing.assert_allclose(sorted(planes.offsets * planes.normals.sum(axis=1)), places, atol=1e-6)


@pytest.mark.parametrize(("tolerance_m", "count"), [(0.02, 2), (0.08, 1)])
def test_what_lies_within_the_tolerance_is_one_plane(tolerance_m, count):
    data, cameras = walls(2.0, 2.06, counts=(600, 400))
    chosen = dataclasses.replace(SETTINGS, plane_tolerance_m=tolerance_m)
    assert len(find_planes(data, cameras, chosen, np.random.default_rng(0)).offsets) == 1 + count


@pytest.mark.parametrize(("share", "bounds"), [(0.88, True), (0.92, False)])
def test_a_bound_has_its_share_of_the_points_before_it(share, bounds):
    data, cameras = walls(2.0, 3.0, counts=(900, 100))
    chosen = dataclasses.replace(SETTINGS, envelope_share=share, plane_share=0.5)
    planes = find_planes(data, cameras, chosen, np.random.default_rng(0))
    (wall,) = matching(planes, np.array([-1.0, 0.0, 0.0]), -2.0)
    assert planes.bounding[wall] == bounds


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_depths_are_where_rays_meet_the_plane(seed):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(5, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = RoomPlanes(normals, rng.normal(size=5), np.ones(5, int), np.ones(5, bool))
    camera = Camera(16, 12, 10.0, 11.0, 8.0, 6.0, look_at(rng.normal(size=3), rng.normal(size=3)))
    depths = planes.depths(camera)
    for depth, normal, offset in zip(depths, planes.normals, planes.offsets, strict=True):
        hit = (depth > 0) & (depth < 100)
        np.testing.assert_allclose(camera.unproject(depth)[hit] @ normal, offset, atol=1e-3)
        directions = camera.rays() @ camera.world_from_camera[:3, :3].T
        faces_camera = camera.centre @ normal > offset
        expected = faces_camera & (directions @ normal < 0)
        assert (expected | (depth == 0)).all()


def test_save_and_load_round_trip(tmp_path, room, observed_points):
    planes = found(room, observed_points)
    planes.save(tmp_path / "planes.npz")
    loaded = RoomPlanes.load(tmp_path / "planes.npz")
    for name in planes.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(planes, name))
    (tmp_path / "planes.npz").write_bytes(b"nothing")
    with pytest.raises(GeometryError):
        RoomPlanes.load(tmp_path / "planes.npz")
