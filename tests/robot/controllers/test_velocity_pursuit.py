"""Velocity commands: where they lead a base that obeys them, and what they never ask for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.robot.controllers.policy_layout import Commands
from r2sego_blender.robot.controllers.policy_observation import Command
from r2sego_blender.robot.controllers.velocity_pursuit import Stage, VelocityPursuit, heading_rad, straight

LIMITS = Commands((-0.5, 1.0), (-0.3, 0.3), (-0.8, 0.8), None, math.nan, 0.0, 0.0)


def obeyed(pursuit: VelocityPursuit, qpos: np.ndarray, seconds: float) -> tuple[np.ndarray, list[Command]]:
    """(T, 3) x, y, heading of a base that does as it is told."""
    x, y, angle = qpos[0], qpos[1], heading_rad(qpos)
    track, commands = [], []
    for _ in range(round(seconds * 50.0)):
        qpos = np.array([x, y, 0.8, math.cos(angle / 2.0), 0.0, 0.0, math.sin(angle / 2.0)])
        command = pursuit.command(qpos, 0.02)
        x += 0.02 * (command.vx_m_s * math.cos(angle) - command.vy_m_s * math.sin(angle))
        y += 0.02 * (command.vx_m_s * math.sin(angle) + command.vy_m_s * math.cos(angle))
        angle += 0.02 * command.yaw_rate_rad_s
        track.append((x, y, angle))
        commands.append(command)
    return np.array(track), commands


def start(heading: float) -> np.ndarray:
    return np.array([0.0, 0.0, 0.8, math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0)])


@settings(max_examples=40, deadline=None)
@given(
    heading=st.floats(-3.1, 3.1), corner=st.tuples(st.floats(0.5, 1.5), st.floats(-1.0, 1.0)), speed=st.floats(0.3, 0.8)
)
def test_walks_keep_to_their_way_and_limits_and_end_standing_at_the_goal(heading, corner, speed):
    corner, end = np.array(corner), np.array([corner[0] + 1.0, corner[1]])
    path = np.concatenate([straight(np.zeros(2), corner), straight(corner, end)])
    track, commands = obeyed(VelocityPursuit([Stage(path)], LIMITS, speed, 1.0), start(heading), 20.0)
    assert np.linalg.norm(track[-1, :2] - end) < 0.1
    away = np.linalg.norm(track[:, None, :2] - path[None], axis=2).min(axis=1)
    assert away.max() < 0.2
    for command in commands:
        assert math.hypot(command.vx_m_s, command.vy_m_s) <= speed + 1e-9
        assert -0.5 - 1e-9 <= command.vx_m_s <= 1.0 and abs(command.vy_m_s) <= 0.3 + 1e-9
        assert abs(command.yaw_rate_rad_s) <= 0.8
    assert not commands[-1].walks
    assert (commands[-1].vx_m_s, commands[-1].vy_m_s, commands[-1].yaw_rate_rad_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("goal", [(2.0, -1.0), (-1.5, 1.5), (0.5, 2.0)])
def test_a_walk_looks_where_it_goes(goal):
    path = straight(np.zeros(2), np.array(goal))
    track, _ = obeyed(VelocityPursuit([Stage(path)], LIMITS, 0.5, 1.0), start(1.0), 20.0)
    under_way = np.linalg.norm(track[:, :2], axis=1)
    middle = (under_way > 1.0) & (under_way < np.linalg.norm(goal) - 0.5)
    off_rad = np.angle(np.exp(1j * (track[middle, 2] - math.atan2(goal[1], goal[0]))))
    assert middle.sum() > 20 and np.abs(off_rad).max() < math.radians(10.0)


@settings(max_examples=20, deadline=None)
@given(heading=st.floats(-3.1, 3.1), turn=st.floats(-3.0, 3.0))
def test_turns_end_at_their_heading(heading, turn):
    stage = Stage(np.zeros((1, 2)), heading + turn)
    track, _ = obeyed(VelocityPursuit([stage], LIMITS, 0.5, 1.0), start(heading), 12.0)
    assert abs(math.remainder(track[-1, 2] - heading - turn, math.tau)) < math.radians(7.0)
    assert np.abs(track[:, :2]).max() < 1e-9


def test_too_slow_commands_are_not_given():
    limits = replace(LIMITS, slowest_m_s=0.3, slowest_turn_rad_s=0.6)
    path = straight(np.zeros(2), np.array([1.0, 0.5]))
    _, commands = obeyed(VelocityPursuit([Stage(path)], limits, 0.5, 0.3), start(0.0), 10.0)
    walking = [math.hypot(command.vx_m_s, command.vy_m_s) for command in commands if command.walks]
    assert min(walking) > 0.29
    _, commands = obeyed(VelocityPursuit([Stage(np.zeros((1, 2)), 1.0)], limits, 0.5, 0.3), start(0.0), 5.0)
    assert all(abs(c.yaw_rate_rad_s) >= 0.6 - 1e-9 for c in commands if c.walks)


def test_heights_change_steadily_and_are_held_while_standing():
    limits = replace(LIMITS, base_height_m=(0.5, 0.75), walking_height_m=0.75)
    place = np.zeros((1, 2))
    stages = [Stage(place, 0.0, 0.75, 0.5), Stage(place, 0.0, 0.55, 1.0), Stage(place, 0.0, 0.75)]
    _, commands = obeyed(VelocityPursuit(stages, limits, 0.5, 1.0), start(0.0), 6.0)
    heights = np.array([command.base_height_m for command in commands])
    assert np.abs(np.diff(heights)).max() <= 0.25 * 0.02 + 1e-9
    assert np.all(heights[:25] == 0.75)
    assert (np.abs(heights - 0.55) < 1e-9).sum() * 0.02 == pytest.approx(1.0, abs=0.05)
    assert heights[-1] == 0.75
    assert not any(command.walks for command in commands)
