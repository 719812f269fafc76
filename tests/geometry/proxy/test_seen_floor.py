"""The floor that captures vouch for."""

from dataclasses import replace

import numpy as np
import pytest
from room_meshes import grid_faces, observed_proxy
from skimage.measure import points_in_poly

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.geometry.proxy.seen_floor import seen_floor

SIDE_M = 0.25


def floor_proxy(width_m: float, depth_m: float = 2.0, height_m: float = 0.0) -> GeometryProxy:
    """A level rectangle from the origin along x, in triangles, seen and vouched for everywhere."""
    columns, rows = round(width_m / SIDE_M), round(depth_m / SIDE_M)
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    vertices = np.stack([SIDE_M * x, SIDE_M * y, np.full(x.shape, height_m)], axis=-1).reshape(-1, 3)
    return observed_proxy(vertices, grid_faces(*x.shape))


def middles(proxy: GeometryProxy) -> np.ndarray:
    return proxy.vertices[proxy.faces].mean(axis=1)


def camera_at(x: float, y: float, towards: tuple[float, float] = (1.0, 0.0)) -> Camera:
    """A wide camera 1.5 m high that looks down on the floor ahead."""
    return Camera(64, 48, 20, 20, 32, 24, look_at((x, y, 1.5), (x + towards[0], y + towards[1], 0.5)))


def inside(corners: np.ndarray, *points: tuple[float, float]) -> list[bool]:
    return points_in_poly(np.array(points), corners).tolist()


def test_it_is_the_floor_that_captures_looked_down_on_and_where_they_stood():
    corners = seen_floor(floor_proxy(3.0), [camera_at(-0.3, 1.0)])
    assert inside(corners, (-0.3, 1.0), (1.0, 1.0), (2.5, 1.0)) == [True] * 3
    assert inside(corners, (-1.2, 1.0), (3.4, 1.0), (1.0, -0.7), (1.0, 2.7)) == [False] * 4


def test_floor_that_goes_on_to_the_horizon_ends_where_it_is_seen_too_flatly():
    corners = seen_floor(floor_proxy(30.0), [camera_at(0.5, 1.0)])
    # Where a camera 1.5 m high sees floor under a cosine of 0.3, it is 4.8 m away.
    assert 0.5 + 4.5 < corners[:, 0].max() < 0.5 + 5.1


def test_floor_on_which_no_depth_lies_does_not_count():
    proxy = floor_proxy(4.0)
    continued = replace(proxy, confidence=np.where(middles(proxy)[:, 0] > 2.0, 0.1, 1.0).astype(np.float32))
    corners = seen_floor(continued, [camera_at(0.3, 1.0)])
    assert 1.9 < corners[:, 0].max() < 2.2


def test_floor_that_no_capture_saw_does_not_count():
    proxy = floor_proxy(4.0)
    unseen = replace(proxy, support=np.where(middles(proxy)[:, 0] > 2.0, 0, 1).astype(np.uint16))
    assert 1.9 < seen_floor(unseen, [camera_at(0.3, 1.0)])[:, 0].max() < 2.2


@pytest.mark.parametrize(("gap_m", "bridged"), [(0.5, True), (1.5, False)])
def test_what_is_hidden_between_near_floors_is_floor(gap_m, bridged):
    proxy = floor_proxy(4.0, 4.0)
    x = middles(proxy)[:, 0]
    hidden = replace(proxy, support=np.where((x > 2.0) & (x < 2.0 + gap_m), 0, 1).astype(np.uint16))
    corners = seen_floor(hidden, [camera_at(-0.5, 1.0), camera_at(-0.5, 3.0)])
    far = (2.0 + gap_m + 0.2, 2.0)
    # Of two pieces the one with more floor is taken.
    assert inside(corners, (1.0, 2.0), (2.0 + gap_m / 2, 2.0), far) == [True, bridged, bridged]


def test_the_outline_is_a_region_for_robots():
    from r2sego_blender.robot.scope.region import problem_of

    rng = np.random.default_rng(0)
    proxy = floor_proxy(6.0, 5.0)
    patchy = replace(proxy, support=rng.integers(0, 2, len(proxy.faces)).astype(np.uint16))
    corners = seen_floor(patchy, [camera_at(0.5, 1.0), camera_at(3.0, 3.0, (-1.0, 0.3)), camera_at(5.0, 0.5, (0, 1))])
    assert problem_of(tuple(map(tuple, corners.tolist()))) == ""


def test_a_patch_of_floor_is_joined_to_where_the_captures_stood():
    patch = floor_proxy(0.5, 0.5)
    corners = seen_floor(
        patch, [camera_at(-0.5, 0.2), camera_at(0.2, -3.0, (0.0, 1.0)), camera_at(3.0, 0.2, (-1.0, 0.0))]
    )
    assert inside(corners, (0.4, 0.4), (1.0, -0.5)) == [True, True]
    assert corners.min(axis=0).tolist() == [-0.5, -3.0] and corners[:, 0].max() == 3.0


def test_without_any_floor_it_is_what_lies_between_the_captures():
    table = floor_proxy(2.0, height_m=0.7)
    corners = seen_floor(table, [camera_at(0.0, 0.0), camera_at(2.0, 0.0), camera_at(0.0, 2.0)])
    assert sorted(map(tuple, corners.tolist())) == [(0.0, 0.0), (0.0, 2.0), (2.0, 0.0)]


def test_a_table_is_no_floor():
    with pytest.raises(GeometryError, match=r"no floor.*robot --region.*in Blender Draw Region"):
        seen_floor(floor_proxy(2.0, height_m=0.7), [camera_at(0.5, 0.5)])
