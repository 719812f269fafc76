"""Seats found on collision surfaces, and robots that sit down on them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.trajectory import Seat
from r2sego_blender.robot.planning.free_floor import FreeFloor, free_floor
from r2sego_blender.robot.planning.seats import find_seats
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope

SCOPE = BehaviourScope.load("sit_down")
SEAT_M, HALF_M = 0.44, 0.22
# Seat and backrest: it faces along +x.
CHAIR = ((0.0, 0.0, HALF_M, HALF_M, SEAT_M / 2), (-HALF_M - 0.03, 0.0, 0.03, HALF_M, 0.45))


def seats_in(box_room, humanoid, boxes, sit_on=SCOPE.sit_on) -> tuple[tuple[Seat, ...], FreeFloor]:
    room = box_room(boxes)
    floor = free_floor(humanoid, SCOPE, room)
    return find_seats(humanoid.half_width_m, floor, sit_on, room), floor


def test_a_chair_s_seat_faces_away_from_its_back(box_room, humanoid):
    seats, floor = seats_in(box_room, humanoid, CHAIR)
    assert len({seat.surface for seat in seats}) == 1
    for seat in seats:
        assert abs(seat.yaw_rad if seat.yaw_rad < math.pi else seat.yaw_rad - 2 * math.pi) < math.radians(30)
        assert seat.height_m == pytest.approx(SEAT_M, abs=1e-6)
        assert seat.edge_m[0] == pytest.approx(HALF_M, abs=0.04)
        assert abs(seat.edge_m[1]) < HALF_M - 0.05
        assert floor.is_free(seat.ahead(seat.approach_m))
    straight = [seat for seat in seats if seat.yaw_rad == 0.0]
    assert straight
    assert all(seat.edge_m[0] == pytest.approx(HALF_M, abs=0.02) for seat in straight)


def test_a_stool_is_sat_on_from_every_side(box_room, humanoid):
    seats, _ = seats_in(box_room, humanoid, CHAIR[:1])
    assert {round(math.degrees(seat.yaw_rad)) for seat in seats} >= {0, 90, 180, 270}
    for degrees in (0, 90, 180, 270):  # the edge is where the seat ends, and the places spread about its middle
        facing = [seat for seat in seats if round(math.degrees(seat.yaw_rad)) == degrees]
        along = [math.cos(math.radians(degrees)), math.sin(math.radians(degrees))]
        places = np.array([seat.edge_m for seat in facing])
        np.testing.assert_allclose(places @ along, HALF_M, atol=0.02)
        assert abs((places @ [-along[1], along[0]]).mean()) < 0.015


def test_a_chair_before_a_wall_is_sat_on_from_its_sides(box_room, humanoid):
    """Its front looks at a cupboard 25 cm away: nobody fits between."""
    cupboard = (HALF_M + 0.25 + 0.2, 0.0, 0.2, 0.6, 0.6)
    wide = ((0.0, 0.0, 0.3, HALF_M, SEAT_M / 2), (-0.33, 0.0, 0.03, HALF_M, 0.45))
    seats, _ = seats_in(box_room, humanoid, (*wide, cupboard))
    assert seats
    for seat in seats:
        assert abs(math.sin(seat.yaw_rad)) > 0.9


@pytest.mark.parametrize(
    "boxes",
    [
        ((0.0, 0.0, 0.4, 0.4, 0.375),),  # a table
        ((0.0, 0.0, 0.4, 0.4, 0.1),),  # a step
        ((0.0, 0.0, 0.08, 0.4, 0.22),),  # too narrow to sit on
    ],
)
def test_what_is_no_seat(box_room, humanoid, boxes):
    with pytest.raises(RobotError, match=r"no seat from 0\.28 to 0\.60 m high.*sit_on\.height_m"):
        seats_in(box_room, humanoid, boxes)


def test_a_target_names_the_surface_nearest_to_it(box_room, humanoid):
    other = (1.4, -1.2, HALF_M, HALF_M, 0.2)
    both, _ = seats_in(box_room, humanoid, (*CHAIR, other))
    assert len({seat.surface for seat in both}) == 2
    stool, _ = seats_in(box_room, humanoid, (*CHAIR, other), replace(SCOPE.sit_on, target=(1.3, -1.0)))
    assert {round(seat.height_m, 3) for seat in stool} == {0.4}
    with pytest.raises(RobotError, match=r"no seat at \(-1\.5, 1\.5\)"):
        seats_in(box_room, humanoid, (*CHAIR, other), replace(SCOPE.sit_on, target=(-1.5, 1.5)))


@pytest.fixture(scope="module")
def sat(humanoid, box_room):
    return successful_rollouts(humanoid, SCOPE, box_room(CHAIR), RolloutSettings(successes=4, max_attempts=10), seed=0)


def test_it_sits_on_the_seat_at_the_end(sat):
    for rollout in sat:
        if not rollout.success:
            continue
        assert rollout.behaviour == "sit_on"
        assert rollout.quality.seated_s >= 3.0
        seated = rollout.times_s > rollout.times_s[-1] - 3.0
        base = rollout.qpos[seated, :3]
        assert (np.abs(base[:, 0]) < HALF_M).all() and (np.abs(base[:, 1]) < HALF_M).all()
        assert (base[:, 2] > SEAT_M + 0.05).all() and (base[:, 2] < SEAT_M + 0.25).all()
        # It walked there, upright, from somewhere else, and looks away from the backrest.
        assert math.dist(rollout.qpos[0, :2], base[-1, :2]) > 0.4
        assert rollout.qpos[0, 2] > 0.7
        w, z = rollout.qpos[-1, [3, 6]]
        assert abs(math.remainder(2.0 * math.atan2(z, w), math.tau)) < math.radians(35.0)


def test_sitting_keeps_to_the_ground(sat):
    for rollout in sat:
        if rollout.success:
            assert rollout.quality.foot_slide_m <= 0.03
            assert rollout.quality.penetration_m <= 0.01
            low, high = rollout.quality.camera_height_m
            assert low < high - 0.1


def test_an_episode_too_short_to_sit_has_no_goal(humanoid, box_room):
    scope = replace(SCOPE, episode=replace(SCOPE.episode, duration_s=4.0))
    settings = RolloutSettings(max_attempts=2, processes=1)
    with pytest.raises(RobotError, match="2 failed by no_goal"):
        successful_rollouts(humanoid, scope, box_room(CHAIR), settings, seed=0)
