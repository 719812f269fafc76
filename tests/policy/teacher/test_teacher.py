"""The teacher takes a robot without physics to the seat, from anywhere, and labels by its arguments alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kinematic_robot import STANDING_M, KinematicRobot
from scipy import ndimage

from r2sego_blender.policy.teacher.cost_to_go import CostToGo
from r2sego_blender.policy.teacher.phase import Name, SeatFrame
from r2sego_blender.policy.teacher.teacher import Teacher
from r2sego_blender.robot.behaviours.trajectory import STAND_OFF_M, Seat
from r2sego_blender.robot.controllers.commanded_drive import DriveLimits
from r2sego_blender.robot.planning.free_floor import CELL_M, FreeFloor

SEATED_S = 2.0


@pytest.fixture(scope="module")
def floor() -> FreeFloor:
    """5 m by 4 m: a wall with one gap across it, a table, and a chair at the far end."""
    free = np.zeros((80, 100), bool)
    free[4:-4, 4:-4] = True
    free[:50, 44:52] = False  # the wall: around it at its upper end alone
    free[30:52, 70:80] = False
    free[8:24, 80:] = False  # the chair, at x = 4 m and beyond
    clearance = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * CELL_M
    return FreeFloor(np.array([0.0, 0.0]), free, free, clearance, 0.02)


@pytest.fixture(scope="module")
def seat() -> Seat:
    return Seat(edge_m=(4.2, 0.8), height_m=0.47, yaw_rad=math.pi, approach_m=0.3)


@pytest.fixture(scope="module")
def teacher(floor: FreeFloor) -> Teacher:
    return Teacher(floor, STANDING_M)


@pytest.fixture(scope="module")
def other_teacher(floor: FreeFloor) -> Teacher:
    """One that is asked for other states in between."""
    return Teacher(floor, STANDING_M)


def anywhere(floor: FreeFloor, seat: Seat | None, rng: np.random.Generator, **options: float) -> KinematicRobot:
    cells = np.argwhere(floor.free)
    row, column = cells[rng.integers(len(cells))]
    return KinematicRobot(floor, seat, floor.points(row, column), rng.uniform(-math.pi, math.pi), **options)


def is_seated(robot: KinematicRobot, teacher: Teacher, steps: int, keeps_off: bool = True) -> bool:
    """Whether the robot comes to sit, without having hit anything if it has to keep off."""
    phase = None
    for _ in range(steps):
        command, phase = teacher.label(robot.state, phase)
        robot.step(command)
        if robot.seated_s > SEATED_S or (keeps_off and robot.has_hit):
            break
    return robot.seated_s > SEATED_S


def test_from_anywhere_it_comes_to_sit_and_touches_nothing_on_the_way(floor, seat, teacher):
    rng = np.random.default_rng(1)
    assert sum(is_seated(anywhere(floor, seat, rng), teacher, 400) for _ in range(100)) >= 98


def test_thrown_off_in_the_middle_it_comes_to_sit_all_the_same(floor, seat, teacher):
    rng = np.random.default_rng(2)
    seated = 0
    for number in range(60):
        robot, phase = anywhere(floor, seat, rng), None
        for _ in range(rng.integers(20, 260)):
            command, phase = teacher.label(robot.state, phase)
            robot.step(command)
        robot.place = robot.place + rng.uniform(-0.3, 0.3, 2)
        robot.yaw_rad += rng.uniform(-math.pi, math.pi)
        robot.velocity = rng.uniform(-0.3, 0.3, 3)
        if number % 3 == 0:
            robot.height_m, robot.seated_s = rng.uniform(0.4, STANDING_M), 0.0
        seated += is_seated(robot, teacher, 450, keeps_off=False)
    assert seated >= 57


def test_where_lowering_finds_no_seat_it_stands_up_steps_ahead_and_sits_deeper(floor, seat, teacher):
    robot = KinematicRobot(floor, seat, seat.ahead(seat.approach_m), seat.yaw_rad, carrying_m=STAND_OFF_M)
    phase, names = None, []
    for _ in range(400):
        command, phase = teacher.label(robot.state, phase)
        names += [phase.name] if names[-1:] != [phase.name] else []
        robot.step(command)
    assert robot.seated_s > SEATED_S
    assert phase.tries == 1
    tried = [Name.BACK_UP, Name.SIT]
    assert names == [*tried, Name.STAND_UP, Name.STEP_AHEAD, Name.TURN, *tried, Name.HOLD]


def test_it_has_its_back_to_the_seat_at_the_stand_off_when_it_sits_down(floor, seat, teacher):
    rng = np.random.default_rng(3)
    for _ in range(5):
        robot, phase = anywhere(floor, seat, rng), None
        while phase is None or phase.name != Name.SIT:
            command, phase = teacher.label(robot.state, phase)
            robot.step(command)
        frame = SeatFrame.of(seat, robot.place, robot.yaw_rad)
        assert STAND_OFF_M - 0.04 < frame.along_m < STAND_OFF_M + 0.05
        assert frame.is_aligned(0.12, 0.06)


def test_walking_it_ends_at_the_goal(floor, teacher):
    rng = np.random.default_rng(4)
    for _ in range(10):
        robot = anywhere(floor, None, rng)
        robot.goal = anywhere(floor, None, rng).place
        for _ in range(300):
            robot.step(teacher.label(robot.state)[0])
            assert not robot.has_hit
        assert math.dist(robot.place, robot.goal) < 0.15
        assert np.abs(robot.velocity).max() < 0.01


@given(
    x=st.floats(-1.0, 6.0),
    y=st.floats(-1.0, 5.0),
    yaw_rad=st.floats(-10.0, 10.0),
    height_m=st.floats(0.0, 1.0),
    seated=st.booleans(),
    later_s=st.floats(0.0, 20.0),
)
@settings(max_examples=40, deadline=None)
def test_any_state_is_labelled_within_the_limits_the_same_each_time(
    floor, seat, teacher, other_teacher, x, y, yaw_rad, height_m, seated, later_s
):
    robot = KinematicRobot(floor, seat, np.array([x, y]), yaw_rad, height_m=height_m, seated_s=float(seated))
    limits, phases = DriveLimits(), [None]
    for _ in range(2):
        state = replace(robot.state, time_s=robot.time_s + later_s)
        command, phase = teacher.label(state, phases[-1])
        assert (command, phase) == other_teacher.label(state, phases[-1])
        for value, (low, high) in (
            (command.vx_m_s, limits.vx_m_s),
            (command.vy_m_s, limits.vy_m_s),
            (command.yaw_rate_rad_s, limits.yaw_rate_rad_s),
        ):
            assert low - 1e-9 <= value <= high + 1e-9
        assert command.sit or not state.is_seated
        robot.step(command)
        phases.append(phase)


def test_ways_are_free_and_no_longer_than_they_must_be(floor, seat):
    ways = CostToGo(floor, seat.ahead(seat.approach_m))
    way = ways.way(np.array([1.0, 0.5]))  # behind the wall, whose end is at (2.4, 2.5)
    assert floor.is_free(way).all()
    np.testing.assert_allclose(way[-1], seat.ahead(seat.approach_m))
    around = math.dist((1.0, 0.5), (2.2, 2.5)) + 0.4 + math.dist((2.6, 2.5), way[-1])
    length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    assert around < length < 1.25 * around


def test_from_where_it_may_not_stand_the_way_leads_to_the_free_floor_first(floor, seat):
    ways = CostToGo(floor, seat.ahead(seat.approach_m))
    way = ways.way(np.array([2.3, 1.0]))  # within the wall
    out = floor.is_free(way).argmax()
    assert out <= 5
    assert floor.is_free(way[out:]).all()
