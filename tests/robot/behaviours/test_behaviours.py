"""Root trajectories of the declared behaviours keep what the scope and the floor say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.robot.behaviours import step_around
from r2sego_blender.robot.behaviours.trajectory import RATE_HZ, REACH_RAD, STAND_OFF_M, RootTrajectory, Seat, eased
from r2sego_blender.robot.planning.course import Course, plan_root
from r2sego_blender.robot.planning.free_floor import FreeFloor, free_floor
from r2sego_blender.robot.scope.scope import Behaviours, BehaviourScope

SCOPE = BehaviourScope.load("walk_and_look")
SEEDS = range(20)


@pytest.fixture(scope="module")
def floor(humanoid, box_room) -> FreeFloor:
    return free_floor(humanoid, SCOPE, box_room())


def only(behaviour: str) -> BehaviourScope:
    nothing = Behaviours(walk_to=0.0, look_around=0.0)
    return replace(SCOPE, behaviours=replace(nothing, **{behaviour: 1.0}))


def drawn(floor, behaviour: str, seats=()) -> list[RootTrajectory]:
    roots = [plan_root(floor, only(behaviour), np.random.default_rng(seed), seats) for seed in SEEDS]
    return [root for root in roots if root is not None]


def test_ease_is_at_rest_at_both_ends():
    phase = np.linspace(-0.5, 1.5, 2001)
    slope = np.gradient(eased(phase), phase)
    np.testing.assert_allclose(eased(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0.0, 0.0, 0.5, 1.0, 1.0])
    assert slope.max() == pytest.approx(1.875, abs=1e-3)
    assert slope.min() >= -1e-9


def test_behaviours_are_drawn_by_their_weights(floor):
    scope = replace(SCOPE, behaviours=Behaviours(walk_to=0.0, look_around=1.0, step_around=2.0, squat=1.0))
    names = [plan_root(floor, scope, np.random.default_rng(seed)).behaviour for seed in range(200)]
    shares = {name: names.count(name) / len(names) for name in set(names)}
    assert shares == pytest.approx({"look_around": 0.25, "step_around": 0.5, "squat": 0.25}, abs=0.1)


def test_steps_around_keep_the_heading_and_the_free_floor(floor):
    for root in drawn(floor, "step_around"):
        assert np.ptp(root.yaw) == 0.0
        assert floor.is_free(root.xy).all()
        velocity = np.linalg.norm(np.diff(root.xy, axis=0), axis=1) * RATE_HZ
        assert velocity.max() < 0.45
        assert math.dist(root.xy[0], root.goal) < 8.0 * 0.3
        np.testing.assert_allclose(root.xy[-1], root.goal, atol=1e-9)
    moved = [np.ptp(root.xy, axis=0).max() for root in drawn(floor, "step_around")]
    assert np.median(moved) > 0.15


def test_squats_go_as_low_as_the_scope_says_and_rise_again(floor):
    low, high = SCOPE.squat.height
    for root in drawn(floor, "squat"):
        assert 1.0 - high <= root.crouch.max() <= 1.0 - low
        assert root.crouch[0] == root.crouch.min() == 0.0
        np.testing.assert_allclose(root.crouch[-1], 0.0, atol=1e-9)
        assert np.ptp(root.xy, axis=0).max() == 0.0
        assert math.degrees(root.lean.max()) <= SCOPE.squat.lean_deg[1] + 1e-9
        assert (root.reach[root.crouch > 0.05] > 0.0).all()


@pytest.mark.parametrize("lean_deg", [(-20.0, -10.0), (-20.0, 10.0), (0.0, 0.0)])
def test_arms_reach_forward_in_squats_however_the_body_leans(floor, lean_deg):
    scope = only("squat")
    scope = replace(scope, squat=replace(scope.squat, lean_deg=lean_deg))
    for seed in SEEDS:
        root = plan_root(floor, scope, np.random.default_rng(seed))
        assert root.reach.min() >= -1e-9
        assert root.reach.max() == pytest.approx(REACH_RAD)


def test_without_pauses_steps_that_find_no_room_come_to_an_end(floor):
    alone = np.zeros_like(floor.free)
    alone[tuple(np.argwhere(floor.free)[0])] = True
    scope = only("step_around")
    scope = replace(scope, step_around=replace(scope.step_around, pause_s=(0.0, 0.0)))
    root = step_around.plan(Patient(replace(floor, free=alone), scope, np.random.default_rng(0), []))
    assert np.ptp(root.xy, axis=0).max() == 0.0


class Patient(Course):
    """A course that is not asked without end; ``seats`` counts."""

    def is_free_between(self, start, end):
        self.seats.append(None)
        assert len(self.seats) < 1_000
        return super().is_free_between(start, end)


def test_sitting_ends_facing_away_from_the_seat(floor):
    seat = Seat(edge_m=(0.9, -0.4), height_m=0.45, yaw_rad=math.radians(250.0), approach_m=0.5)
    scope = replace(only("sit_on"), episode=replace(SCOPE.episode, duration_s=25.0))
    roots = [plan_root(floor, scope, np.random.default_rng(seed), [seat]) for seed in SEEDS]
    assert all(root is not None for root in roots)
    for root in roots:
        assert abs(math.remainder(root.yaw[-1] - seat.yaw_rad, math.tau)) < 0.03
        np.testing.assert_allclose(root.xy[-1], seat.ahead(STAND_OFF_M), atol=1e-6)
        np.testing.assert_allclose(root.goal, seat.ahead(-root.depth_m), atol=1e-9)
        assert (np.diff(root.sit) >= 0.0).all() and root.sit[0] == 0.0 and root.sit[-1] == 1.0
        # It stands before the seat when it begins to sit, and stays for as long as is asked.
        standing = np.linalg.norm(root.xy - seat.ahead(STAND_OFF_M), axis=1)
        assert standing[root.sit > 0.0].max() < 1e-3
        assert (root.sit == 1.0).sum() / RATE_HZ >= scope.sit_on.hold_s
        assert len(root.xy) / RATE_HZ <= 25.0 + 1.0 / RATE_HZ


def test_nothing_to_sit_on_is_no_goal(floor):
    assert plan_root(floor, only("sit_on"), np.random.default_rng(0), ()) is None
