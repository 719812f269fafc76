"""Depth goes on from what is known around, to where the photographs say nothing."""

import numpy as np
import pytest
from scipy import ndimage

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.patch_depth import ColourView
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.room.point_evidence import PointEvidence
from r2sego_blender.geometry.room.propagation import propagated_depth
from r2sego_blender.geometry.stereo.evidence import KnownDepth

CAMERA = Camera(180, 120, 155.9, 155.9, 90.0, 60.0, look_at(np.array([0.0, 0.0, 1.0]), np.array([0.0, 4.0, 1.0])))
DOOR_M, WALL_M = 2.0, 4.0
DOOR = np.s_[:, 20:90]  # a blue door in the left half, before a beige wall
LAST = np.full(CAMERA.shape, WALL_M + 0.05, np.float32)


def planes_of(wall_inliers):
    """A cupboard's door, and the wall behind it, which bounds the room."""
    return RoomPlanes(
        np.array([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]]),
        np.array([-DOOR_M, -WALL_M]),
        np.array([20, wall_inliers]),
        np.array([False, True]),
    )


def view_of(known=None):
    image = np.full((*CAMERA.shape, 3), (0.8, 0.75, 0.6), np.float32)
    image[DOOR] = (0.1, 0.2, 0.6)
    return ColourView(CAMERA, image, np.zeros(CAMERA.shape, np.float32) if known is None else known)


def points_at(rows, columns, depth_m):
    rows, columns = np.meshgrid(rows, columns)
    world = CAMERA.unproject(np.full(CAMERA.shape, depth_m))
    return PointEvidence.of(CAMERA, world[rows.ravel(), columns.ravel()])


UNSEEN = np.zeros(CAMERA.shape, np.float32)
HANDLES = points_at(range(16, 110, 16), range(30, 90, 12), DOOR_M)


def test_a_door_goes_on_as_far_as_its_colour():
    wall = np.zeros(CAMERA.shape, np.float32)
    wall[30:60, 140:170] = WALL_M
    depth = propagated_depth(view_of(wall), HANDLES, UNSEEN, planes_of(1000), LAST, [])
    assert (np.abs(depth[DOOR] / DOOR_M - 1.0) < 0.02).mean() > 0.95
    assert (np.abs(depth[:, 100:] / WALL_M - 1.0) < 0.02).mean() > 0.95


def test_where_little_is_known_the_envelope_is_likelier():
    far_away = points_at([60], [2], DOOR_M)
    depth = propagated_depth(view_of(), far_away, UNSEEN, planes_of(1000), LAST, [])
    assert (np.abs(depth[:, 100:] / WALL_M - 1.0) < 0.02).all()


def test_a_bound_that_colours_told_stays():
    depth = propagated_depth(view_of(), HANDLES, UNSEEN, planes_of(0), LAST, [])
    assert (np.abs(depth[:, 100:] / WALL_M - 1.0) < 0.02).all()


BESIDE = CAMERA.at(look_at(np.array([-1.6, 0.0, 1.0]), np.array([-1.6, 4.0, 1.0])))


def test_a_door_ends_where_another_capture_sees_through_it():
    """It sees the wall through the left part of what has the door's colour."""
    wall = KnownDepth(BESIDE, np.full(CAMERA.shape, WALL_M, np.float32))
    depth = propagated_depth(view_of(), HANDLES, UNSEEN, planes_of(1000), LAST, [wall])
    on_door = CAMERA.unproject(np.full(CAMERA.shape, DOOR_M))
    through = BESIDE.sees(*BESIDE.project(on_door))
    assert 0.2 < through[DOOR].mean() < 0.8
    inside = ndimage.binary_erosion(through, iterations=6)[DOOR]
    assert (np.abs(depth[DOOR][inside] / WALL_M - 1.0) < 0.02).mean() > 0.95
    beside = ndimage.binary_erosion(~through, iterations=6)[DOOR]
    assert (np.abs(depth[DOOR][beside] / DOOR_M - 1.0) < 0.02).mean() > 0.95


def test_what_no_plane_explains_goes_on_unless_another_capture_sees_through_it():
    explained_by_none = RoomPlanes(
        np.array([[0.0, -1.0, 0.0]]), np.array([-WALL_M]), np.array([1000]), np.array([False])
    )
    beside_a_handle = np.s_[60:68, 28:36]
    for others, depth_m in (
        ([], DOOR_M),
        ([KnownDepth(BESIDE, np.full(CAMERA.shape, WALL_M, np.float32))], LAST[0, 0]),
    ):
        depth = propagated_depth(view_of(), HANDLES, UNSEEN, explained_by_none, LAST, others)
        np.testing.assert_allclose(depth[beside_a_handle], depth_m, rtol=0.02)


def test_nothing_goes_on_beyond_what_ends_the_room():
    last = np.full(CAMERA.shape, 1.5, np.float32)
    depth = propagated_depth(view_of(), HANDLES, UNSEEN, planes_of(1000), last, [])
    assert depth.max() <= 1.5


@pytest.mark.parametrize("without", ["planes", "points"])
def test_without_planes_or_anything_known_nothing_is_said(without):
    none = RoomPlanes(np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.int64), np.zeros(0, bool))
    nothing = PointEvidence.of(CAMERA, np.zeros((0, 3)))
    planes, points = (none, HANDLES) if without == "planes" else (planes_of(9), nothing)
    assert not propagated_depth(view_of(), points, UNSEEN, planes, LAST, []).any()


def test_what_other_captures_were_completed_by_goes_on_less_surely_than_what_is_trusted():
    """A band of the door is all that is known of it; the wall beside it is known, too."""
    band = np.where(np.arange(CAMERA.width) < 60, np.float32(DOOR_M), np.float32(0.0))
    band = np.where(np.abs(np.arange(CAMERA.height) - 60)[:, None] < 12, band, np.float32(0.0))
    wall = np.where(np.arange(CAMERA.width)[None] > 140, np.full(CAMERA.shape, WALL_M, np.float32), np.float32(0.0))
    nothing = PointEvidence.of(CAMERA, np.zeros((0, 3)))
    on_door = {}
    for name, known, seen in (("trusted", wall + band, UNSEEN), ("seen", wall, band), ("unknown", wall, UNSEEN)):
        depth = propagated_depth(view_of(known), nothing, seen, planes_of(1000), LAST, [])
        on_door[name] = (np.abs(depth[DOOR] / DOOR_M - 1.0) < 0.02).mean()
    assert on_door["unknown"] == 0.0 < 0.2 < on_door["seen"] <= on_door["trusted"]
