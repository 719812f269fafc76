"""Where a robot can begin: every pose stands and leads to its seat, and what is refused cannot."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial.distance import cdist

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import Seat
from r2sego_blender.robot.planning.free_floor import FreeFloor, free_floor
from r2sego_blender.robot.planning.navigation import path_between
from r2sego_blender.robot.rollouts.spawn_poses import Refusal, _candidates, find_spawn_poses
from r2sego_blender.robot.scope.scope import BehaviourScope

CHAIR = ((-1.0, 0.0, 0.25, 0.25, 0.21), (-1.3, 0.0, 0.05, 0.25, 0.45))
SIT = BehaviourScope.load("sit_down")


@pytest.fixture(scope="module")
def room(box_room):
    return box_room(CHAIR)


@pytest.fixture(scope="module")
def poses(humanoid, room):
    return find_spawn_poses(humanoid, SIT, room, RolloutSettings(), 3)


def test_each_is_free_and_leads_to_the_nearest_of_the_seats(poses, humanoid, room):
    floor = free_floor(humanoid, SIT, room)
    assert len(poses.proven) >= 40 and poses.seats
    for pose in poses.proven:
        assert floor.is_free(np.array(pose.xy_m))
        here = tuple(map(int, floor.cells(np.array(pose.xy_m))))
        before = [seat.ahead(seat.approach_m) for seat in poses.seats]
        assert pose.seat is not None
        path = path_between(floor, here, tuple(map(int, floor.cells(before[pose.seat]))))
        assert path is not None
        straight_m = math.dist(pose.xy_m, before[pose.seat])
        assert pose.way_m > straight_m - 0.1
        assert pose.way_m < 3.0 * straight_m + 0.3  # a cell near an edge counts three times


@settings(deadline=None, max_examples=40)
@given(rows=st.integers(1, 40), columns=st.integers(1, 40), seed=st.integers(0, 2**16))
def test_of_any_floor_no_two_candidates_are_near_and_nothing_is_far_from_all(rows, columns, seed):
    made_up = ndimage.uniform_filter(np.random.default_rng(seed).random((rows, columns)), 5)
    region, free = made_up >= np.median(made_up), made_up >= np.quantile(made_up, 0.7)
    floor = FreeFloor(np.array([-1.3, 0.7]), free, region, np.zeros(free.shape), 0.0)
    first, again, other = (_candidates(floor, np.random.default_rng(draw)) for draw in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(np.unique(first, axis=0), np.unique(other, axis=0))
    assert region[tuple(first.T)].all()
    places = floor.points(*first.T)
    apart_m = cdist(places, places) + np.diag(np.full(len(places), np.inf))
    assert apart_m.min() > 0.25 - 1e-9
    for cells, candidates in ((region, places), (free, places[free[tuple(first.T)]])):
        assert cdist(floor.points(*np.nonzero(cells)), candidates).min(axis=1).max() < 0.25


def test_what_is_refused_lies_where_the_robot_does_not_fit(poses, humanoid, room):
    floor = free_floor(humanoid, SIT, room)
    assert {pose.refusal for pose in poses.refused} == {Refusal.NOT_FREE}
    assert not floor.is_free(np.array([pose.xy_m for pose in poses.refused])).any()
    assert [pose for pose in poses.refused if math.dist(pose.xy_m, CHAIR[0][:2]) < 0.5]


def test_the_same_arguments_give_the_same_file_and_another_seed_other_headings(poses, humanoid, room, tmp_path):
    again, other = (find_spawn_poses(humanoid, SIT, room, RolloutSettings(), seed) for seed in (3, 4))
    assert again == poses and other.proven != poses.proven
    poses.save(tmp_path / "spawn_poses.json")
    told = json.loads((tmp_path / "spawn_poses.json").read_text())
    assert [Seat(**seat | {"edge_m": tuple(seat["edge_m"])}) for seat in told["seats"]] == list(poses.seats)
    assert [tuple(pose["xy_m"]) for pose in told["poses"]] == [pose.xy_m for pose in poses.proven]
    assert all(-math.pi <= pose["yaw_rad"] <= math.pi for pose in told["poses"])
    assert {pose["refusal"] for pose in told["refused"]} == {"not_free"}


def test_a_floor_that_is_too_soft_is_told_from_one_that_is_not_free(humanoid, box_room):
    """A floor that rays and probes meet, and that lets a robot sink."""
    room = box_room(CHAIR)
    soft = 'solref="0.4 1" solimp="0.01 0.02 0.5"'
    room.write_text(room.read_text().replace('name="floor"', f'name="floor" {soft} priority="1"'))
    poses = find_spawn_poses(humanoid, SIT, room, RolloutSettings(), 0)
    assert not poses.proven
    assert sum(pose.refusal is Refusal.DOES_NOT_STAND and pose.detail != "" for pose in poses.refused) >= 40


def test_without_a_seat_there_are_none_to_sit_from_and_all_to_walk_from(humanoid, box_room):
    with pytest.raises(RobotError):
        find_spawn_poses(humanoid, SIT, box_room([]), RolloutSettings(), 0)
    walk = BehaviourScope.load("walk_and_look")
    poses = find_spawn_poses(humanoid, walk, box_room([]), RolloutSettings(), 0)
    assert poses.proven and not poses.seats and all(pose.seat is None for pose in poses.proven)
