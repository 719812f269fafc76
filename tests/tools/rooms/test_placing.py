"""Captures around a room hardly overlap and stand free; frozen views are far from them."""

import numpy as np
import pytest
import trimesh

from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from tools.rooms.around import lens_of
from tools.rooms.free_floor import CELL_M, free_floor
from tools.rooms.placing import MOST_OVERLAP, captures_around, farthest_views
from tools.rooms.seen import overlap_share

LOW, HIGH = np.array([-3.0, -2.5]), np.array([3.0, 2.5])
CABINET = np.array([[1.0, -2.5], [3.0, -1.5]])


@pytest.fixture(scope="module")
def room() -> tuple[np.ndarray, np.ndarray]:
    """Six by five metres, a cabinet in a corner and a lamp's shade above heads."""
    shell = trimesh.creation.box(bounds=[[*LOW, 0.0], [*HIGH, 2.6]])
    cabinet = trimesh.creation.box(bounds=[[*CABINET[0], 0.0], [*CABINET[1], 1.2]])
    shade = trimesh.creation.box(bounds=[[-0.3, -0.3, 2.1], [0.3, 0.3, 2.3]])
    mesh = trimesh.util.concatenate([shell, cabinet, shade])
    return np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)


@pytest.fixture(scope="module")
def floor(room):
    return free_floor(*room, LOW, HIGH)


def test_clearance_is_the_distance_to_walls_and_furniture_below_heads(floor):
    at = np.array([[0.0, 0.0], [-2.5, 0.0], [2.0, -1.0], [2.0, -2.0], [9.0, 0.0]])
    expected = [min(2.5, np.hypot(1.0, 1.5)), 0.5, 0.5, 0.0, 0.0]
    assert floor.at(at) == pytest.approx(expected, abs=2 * CELL_M)


def test_six_captures_around_a_room_hardly_overlap_and_stand_free(room, floor):
    rasterizer = MeshRasterizer(*room)
    captures = captures_around(rasterizer, floor, lens_of(160))
    depths = [rasterizer.render(capture).depth for capture in captures]
    assert len(captures) == 6
    assert overlap_share(captures, depths) <= MOST_OVERLAP
    headings = np.sort(np.degrees([np.arctan2(c.forward[1], c.forward[0]) for c in captures]))
    assert np.diff(headings) == pytest.approx(60.0)
    centres = np.array([capture.centre for capture in captures])
    assert (floor.at(centres[:, :2]) >= 0.2).all()
    assert ((centres[:, 2] > 1.4) & (centres[:, 2] < 1.6)).all()


def test_frozen_views_are_far_from_captures_and_the_same_for_a_seed(room, floor):
    rasterizer = MeshRasterizer(*room)
    captures = [lens_of(64).at(one.world_from_camera) for one in captures_around(rasterizer, floor, lens_of(64))]
    views, again, other = (farthest_views(rasterizer, floor, captures, 8, seed) for seed in (1, 1, 2))
    poses = np.array([view.world_from_camera for view in views])
    assert (poses == [view.world_from_camera for view in again]).all()
    assert (poses != [view.world_from_camera for view in other]).any()
    places = floor.places(0.3)
    nearest = [min(np.linalg.norm(view.centre[:2] - c.centre[:2]) for c in captures) for view in views]
    everywhere = np.min([np.linalg.norm(places - c.centre[:2], axis=1) for c in captures], axis=0)
    assert nearest[0] == pytest.approx(everywhere.max())
    assert (floor.at(poses[:, :2, 3]) >= 0.3).all()
    down = np.degrees(np.arcsin(-poses[:, 2, 2]))
    assert ((down >= 22.0) & (down <= 45.0)).all()
