"""Detours around things that stand in the way, checked on the things themselves."""

import numpy as np
import pytest
from box_room import proxy
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from r2sego_blender.generation.paths.detours import CLEARANCE_M, ClearSpace, _occupied, along
from r2sego_blender.generation.paths.paths import eased

WALL = (np.array([-0.1, -2.0, 0.0]), np.array([0.1, 0.9, 2.5]))  # it leaves a door at y > 0.9
CLOSED = (np.array([-0.1, -2.0, 0.0]), np.array([0.1, 2.0, 2.5]))


def clear_space(*boxes) -> ClearSpace:
    """The box room with ``boxes`` in it."""
    room = proxy(boxes)
    return ClearSpace(room.vertices, room.faces)


def within(points, box, margin_m=0.0):
    """(n,) bool: which points are in the box, grown by a margin."""
    return ((points > box[0] - margin_m) & (points < box[1] + margin_m)).all(axis=-1)


def densely(points):
    return along(points, np.linspace(0.0, 1.0, 5000))


place = st.tuples(st.floats(-1.8, 1.8), st.floats(-1.8, 1.8), st.floats(0.3, 2.2)).map(np.array)
side = st.tuples(st.floats(0.2, 0.8), st.floats(0.2, 0.8), st.floats(0.2, 0.8)).map(np.array)


@settings(max_examples=25, deadline=None)
@given(place, side, place, place)
def test_a_way_around_a_box_is_clear_and_ends_exactly(middle, half, start, goal):
    box = np.maximum(middle - half, [-1.5, -1.5, -1.0]), np.minimum(middle + half, [1.5, 1.5, 2.0])
    ends = np.stack([start, goal])
    assume((box[1] - box[0] > 0.1).all() and not within(ends, box, 0.02).any())
    space = clear_space(box)
    way = space.way(start, goal)
    np.testing.assert_array_equal(way.points[[0, -1]], ends)
    straight = np.linspace(start, goal, 5000)
    if not way.note:
        np.testing.assert_array_equal(way.points, ends)
        assert not within(straight, box, -1e-6).any()
    else:
        assert way.note.startswith("a detour")
        assert within(straight, box, 1e-6).any()
        assert not space.cuts(way.points)
        assert not within(densely(way.points), box).any()
        steps = np.linalg.norm(np.diff(way.points, axis=0), axis=1)
        assert steps.max() < 0.03 or len(way.points) < 6  # rounded, or the taut way
    places = along(way.points, eased(25))
    length_m = np.linalg.norm(np.diff(way.points, axis=0), axis=1).sum()
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= 1.6 * length_m / 24 + 1e-9
    assert not within(places, box).any()


def test_a_detour_goes_through_the_door_with_clearance_and_is_not_much_longer_than_it_must():
    start, goal = np.array([-1.2, -0.5, 1.3]), np.array([1.2, -0.5, 1.3])
    way = clear_space(WALL).way(start, goal)
    points = densely(way.points)
    assert not within(points, WALL, 0.5 * CLEARANCE_M).any()
    crossing = points[np.abs(points[:, 0]) < 0.1]
    assert (crossing[:, 1] > 0.9 + 0.5 * CLEARANCE_M).all()
    shortest_m = 2 * np.hypot(1.1, 1.4) + 0.2
    length_m = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert shortest_m < length_m < 1.2 * shortest_m
    turns = np.diff(way.points, axis=0)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((turns[1:] * turns[:-1]).sum(1), -1, 1))).max() < 25.0
    assert f"{length_m:.2f} m" in way.note


def test_the_same_question_gets_the_same_bits():
    start, goal = np.array([-1.2, -0.5, 1.3]), np.array([1.2, -0.5, 1.3])
    space = clear_space(WALL)
    first = space.way(start, goal).points
    np.testing.assert_array_equal(space.way(start, goal).points, first)
    np.testing.assert_array_equal(clear_space(WALL).way(start, goal).points, first)


@pytest.mark.parametrize("goal", [[1.2, -0.5, 1.3], [0.0, 0.0, 1.0], [0.0, 0.0, 9.0]])
def test_where_there_is_no_way_the_line_is_straight_and_says_so(goal):
    """Behind a wall from side to side, inside it, and outside the room."""
    start = np.array([-1.2, -0.5, 1.3])
    way = clear_space(CLOSED).way(start, np.array(goal))
    np.testing.assert_array_equal(way.points, [start, goal])
    assert "no way around" in way.note


def test_an_end_close_to_a_surface_still_finds_its_way():
    start, goal = np.array([-0.13, -0.5, 1.3]), np.array([0.13, -0.5, 1.3])
    space = clear_space(WALL)
    way = space.way(start, goal)
    assert way.note.startswith("a detour")
    assert not space.cuts(way.points)
    points = densely(way.points)
    assert not within(points, WALL).any()


def test_cuts_are_those_of_the_triangles():
    """Against the planes' equations: a line through a random triangle, and one beside it."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        corners = rng.normal(size=(3, 3))
        space = ClearSpace(corners, np.array([[0, 1, 2]]))
        weights = rng.dirichlet(np.ones(3))
        through, offset = weights @ corners, rng.normal(size=3)
        assert space.cuts(np.stack([through - offset, through + offset]))
        assert not space.cuts(np.stack([through + 0.1 * offset, through + offset]))
        beside = np.array([1.2, -0.1, -0.1]) @ corners
        assert not space.cuts(np.stack([beside - offset, beside + offset]))
        assert space.cuts(np.stack([through + 2 * offset, through + offset, through - offset]))


def test_occupied_voxels_are_those_with_a_surface():
    rng = np.random.default_rng(5)
    corners = rng.uniform(0.0, 1.0, (30, 3, 3))
    shape = np.array([11, 11, 11])
    occupied = _occupied(corners, np.zeros(3), 0.1, shape)
    weights = rng.dirichlet(np.ones(3), (30, 4000))
    points = np.einsum("fpk,fkc->fpc", weights, corners).reshape(-1, 3)
    index = (points / 0.1).astype(int)
    grown = ndimage.binary_dilation(occupied, np.ones((3, 3, 3)))
    assert occupied[tuple(index.T)].mean() > 0.95
    assert grown[tuple(index.T)].all()
    hit = np.zeros_like(occupied)
    hit[tuple(index.T)] = True
    assert not (occupied & ~ndimage.binary_dilation(hit, np.ones((3, 3, 3)))).any()
