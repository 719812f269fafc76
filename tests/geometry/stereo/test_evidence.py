"""Votes of depth maps on points, against plain numpy; and the small parts beside them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.envelope import envelope_polygons, plane_axes, tessellated
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.stereo.edges import aligned_to_edges
from r2sego_blender.geometry.stereo.evidence import KnownDepth, collect_votes
from r2sego_blender.geometry.surfaces.tsdf import DistanceField


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_votes_equal_the_plain_reference(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(200, 3))
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    views, agree, through, front = [], 0, 0, 0
    for _ in range(3):
        camera = Camera(24, 18, 14.0, 15.0, 12.0, 9.0, look_at(rng.normal(size=3) * 2, rng.normal(size=3)))
        depth = np.where(rng.random((18, 24)) < 0.2, 0, rng.uniform(1, 4, (18, 24))).astype(np.float32)
        views.append(KnownDepth(camera, depth))
        pixels, z = camera.project(points)
        inside = camera.sees(pixels, z) & (z >= 1e-3)
        u, v = np.where(inside[:, None], pixels, 0).astype(int).T
        known = np.where(inside, depth[v, u], 0)
        away = camera.centre - points
        facing = (normals * away).sum(1) / np.linalg.norm(away, axis=1) >= 0.3
        through = through + ((known > 0) & (known > z * 1.1))
        front = front + ((known > 0) & (known < z * 0.9))
        agree = agree + ((known > 0) & (known <= z * 1.1) & (known >= z * 0.9) & facing)
    votes = collect_votes(points, views, 0.1, normals, 0.3)
    np.testing.assert_array_equal(votes.through, through)
    np.testing.assert_array_equal(votes.front, front)
    np.testing.assert_array_equal(votes.agree, agree)


def test_a_fattened_silhouette_shrinks_to_the_images_edge():
    """A red square before a blue wall: its depth spilled three pixels over its border."""
    camera = Camera(60, 60, 60.0, 60.0, 30.0, 30.0, np.eye(4))
    square = np.zeros((60, 60), bool)
    square[20:40, 20:40] = True
    spilled = np.zeros((60, 60), bool)
    spilled[17:43, 17:43] = True
    image = np.where(square[..., None], (0.8, 0.2, 0.1), (0.2, 0.3, 0.7)).astype(np.float32)
    depth = np.where(spilled, 2.0, 3.0).astype(np.float32)
    normal = np.broadcast_to(np.float32([0, 0, -1]), (60, 60, 3))
    mode, votes, own = aligned_to_edges(image, depth, normal, camera)
    replaced = votes > own
    np.testing.assert_allclose(mode, np.where(square, 2.0, 3.0), rtol=1e-4)
    assert replaced[spilled & ~square].all()
    assert not replaced[~spilled].any()


def test_slanted_surfaces_are_extended_along_their_own_plane():
    camera = Camera(64, 48, 60.0, 60.0, 32.0, 24.0, np.eye(4))
    normal = np.array([0.3, -0.5, -0.8]) / np.linalg.norm([0.3, -0.5, -0.8])
    depth = (-1.6 / (camera.rays() @ normal)).astype(np.float32)
    holed = depth.copy()
    holed[20:24, 30:34] = 0
    normals = np.broadcast_to(normal.astype(np.float32), (48, 64, 3))
    image = np.full((48, 64, 3), 0.5, np.float32)
    mode, _, _ = aligned_to_edges(image, holed, normals, camera)
    np.testing.assert_allclose(mode, depth, rtol=2e-3)


def test_the_fused_field_of_one_plane_is_that_plane():
    camera = Camera(80, 60, 60.0, 60.0, 40.0, 30.0, look_at((0, -2, 1), (0, 0, 0.8)))
    plane = RoomPlanes(
        np.array([[0.1, -1.0, 0.05]]) / np.linalg.norm([0.1, -1.0, 0.05]),
        np.zeros(1),
        np.ones(1, int),
        np.ones(1, bool),
    )
    depth = plane.depths(camera)[0]
    field = DistanceField.covering(np.array([-0.5, -0.3, 0.5]), np.array([0.5, 0.3, 1.2]), 0.03, 0.1)
    field.integrate(camera, depth, np.ones_like(depth))
    vertices, faces = field.surface()
    assert len(faces) > 500
    assert np.abs(vertices @ plane.normals[0]).max() < 0.006
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a) @ plane.normals[0] > 0).mean() > 0.99


def test_an_empty_field_has_no_surface():
    field = DistanceField.covering(np.zeros(3), np.ones(3), 0.1, 0.2)
    vertices, faces = field.surface()
    assert vertices.shape == (0, 3)
    assert faces.shape == (0, 3)


def box_planes(turn):
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    normals = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], float) @ rotation.T
    offsets = np.array([0.0, -2.0, -2.0, -1.5, -2.4])
    return RoomPlanes(normals, offsets, np.ones(5, int), np.ones(5, bool)), rotation


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_polygons_bound_the_room_and_end_at_the_box_where_it_is_open(turn):
    planes, rotation = box_planes(turn)
    low, high = np.array([-9.0, -9, -1]), np.array([9.0, 9, 5])
    polygons = envelope_polygons(planes, low, high)
    for polygon, normal, offset in zip(polygons, planes.normals, planes.offsets, strict=True):
        np.testing.assert_allclose(polygon @ normal, offset, atol=1e-9)
        assert (planes.signed_distance(polygon) > -1e-9).all()
        turning = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[1])
        assert turning @ normal > 0
    far_wall = polygons[3] @ rotation
    np.testing.assert_allclose(np.ptp(far_wall, axis=0), (4.0, 0.0, 2.4), atol=1e-9)
    if turn == 0.0:
        assert polygons[0][:, 1].min() == pytest.approx(-9.0)  # no wall was seen on that side


def test_cells_tile_a_rectangle_exactly():
    normal = np.array([0.0, -1.0, 0.0])
    right, up = plane_axes(normal)
    corners = np.array([[0, 0], [1.3, 0], [1.3, 0.7], [0, 0.7]]) @ np.stack([right, up]) - 2 * normal
    cells = tessellated(corners, normal, 0.1)
    edges = np.diff(cells[:, [0, 1, 2]], axis=1)
    areas = np.cross(edges[:, 0], edges[:, 1]) @ normal
    assert len(cells) == 13 * 7
    assert areas.sum() == pytest.approx(1.3 * 0.7)
    assert (areas > 0).all()
