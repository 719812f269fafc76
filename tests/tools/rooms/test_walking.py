"""Walks through a room: nested sets, equal intervals, and stops that are free."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from tools.rooms.around import lens_of
from tools.rooms.free_floor import free_floor
from tools.rooms.walking import NESTED, along, loop_around, nested_sets, routine_views, walk_captures

LOW, HIGH = np.array([-3.0, -2.5]), np.array([3.0, 2.5])


@pytest.fixture(scope="module")
def floor():
    shell = trimesh.creation.box(bounds=[[*LOW, 0.0], [*HIGH, 2.6]])
    cabinet = trimesh.creation.box(bounds=[[1.0, -2.5, 0.0], [3.0, -0.8, 1.2]])
    mesh = trimesh.util.concatenate([shell, cabinet])
    return free_floor(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32), LOW, HIGH)


@given(st.integers(45, 400))
def test_each_set_is_within_the_next_and_its_intervals_are_nearly_equal(count):
    sets = nested_sets(count)
    assert list(sets) == sorted(NESTED)
    smaller: set[int] = set()
    for size, chosen in sets.items():
        assert len(set(chosen)) == size and chosen == sorted(chosen)
        assert smaller <= set(chosen)
        assert chosen[0] == 0 and chosen[-1] == count - 1
        steps = np.diff(chosen)
        assert steps.max() <= 2 * count / size + 2
        smaller = set(chosen)


def test_stops_are_at_equal_intervals_of_the_path():
    corner = np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 1.0)])
    places, travel = along(corner, 5, closed=False)
    assert places == pytest.approx(np.array([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)]))
    assert travel[[0, 1, 4]] == pytest.approx([0.0, 0.0, 90.0])
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    places, _ = along(square, 4, closed=True)
    assert places == pytest.approx(square)


def test_walks_and_rounds_stay_clear_of_what_stands_there(floor):
    for reach in (0.4, 0.8, 0.95):
        assert (floor.at(loop_around(floor, reach)) > 0.2).all()
    captures = walk_captures(floor, lens_of(64), 45, 1.52, 1.0, 90.0, 5)
    centres = np.array([one.centre for one in captures])
    assert (floor.at(centres[:, :2]) > 0.2).all()
    assert np.abs(centres[:, 2] - 1.52).max() < 0.02
    steps = np.linalg.norm(np.diff(centres[:, :2], axis=0), axis=1)
    assert steps.max() < 1.3 * steps.min()
    inwards = [one.forward[:2] @ (centres[:, :2].mean(axis=0) - one.centre[:2]) > 0.0 for one in captures]
    assert np.mean(inwards) > 0.9


def test_routine_views_look_down_from_a_robots_head_and_a_seed_is_one_route(floor):
    views, again, other = (routine_views(floor, lens_of(64), 8, seed) for seed in (1, 1, 2))
    poses = np.array([view.world_from_camera for view in views])
    assert (poses == [view.world_from_camera for view in again]).all()
    assert (poses != [view.world_from_camera for view in other]).any()
    assert ((poses[:, 2, 3] >= 1.2) & (poses[:, 2, 3] <= 1.28)).all()
    down = np.degrees(np.arcsin(-poses[:, 2, 2]))
    assert ((down >= 22.0) & (down <= 45.0)).all()
    assert (floor.at(poses[:, :2, 3]) > 0.2).all()
