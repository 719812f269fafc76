"""Legs followed frame by frame come to what is found for all frames of a motion at once."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.robot.model.kinematics import LegSolver
from r2sego_blender.robot.model.leg_tracker import LegTracker

FRAMES = 60


def motion(robot) -> tuple[np.ndarray, np.ndarray]:
    """A base that goes round in a circle, up and down, over feet of which one swings and turns."""
    at = np.arange(FRAMES) / 50.0
    qpos = np.tile(robot.rest_qpos, (FRAMES, 1))
    part = robot.leg_m
    qpos[:, 0] = 0.1 * part * np.sin(4.0 * at)
    qpos[:, 1] = 0.05 * part * np.cos(4.0 * at)
    qpos[:, 2] = robot.rest_height_m - part * (0.12 - 0.06 * np.cos(3.0 * at))
    soles = np.zeros((len(robot.legs), FRAMES, 4))
    soles[..., :2] = robot.foot_offsets_m[:, None]
    soles[..., 2] = np.array([leg.sole_m for leg in robot.legs])[:, None]
    soles[0, :, 2] += 0.1 * part * np.sin(5.0 * at) ** 2
    soles[0, :, 3] = 0.2 * np.sin(2.0 * at)
    return qpos, soles


@pytest.mark.parametrize("name", ["humanoid", "quadruped", "hexapod"])
def test_it_finds_what_is_found_for_a_whole_motion(name, request):
    robot = request.getfixturevalue(name)
    qpos, soles = motion(robot)
    known, tracked = qpos.copy(), qpos.copy()
    missed_m = LegSolver(robot).solve(known, soles)
    assert missed_m.max() < 1e-4
    tracker = LegTracker(robot)
    for frame in range(FRAMES):
        tracker.solve(tracked[frame], soles[:, frame])
        assert tracker.missed_m(tracked[frame], soles[:, frame]).max() < 1e-4
    np.testing.assert_allclose(tracked, known, atol=2e-3)


def test_a_leg_that_was_stretched_too_far_comes_back(humanoid):
    """And one that cannot reach its place is as near as it can be."""
    qpos, soles = motion(humanoid)
    tracker, solver = LegTracker(humanoid), LegSolver(humanoid)
    far = qpos[0].copy()
    far[2] = humanoid.rest_height_m + 0.2
    tracker.solve(far, soles[:, 0])
    known = far[None].copy()
    missed_m = solver.solve(known, soles[:, :1])[:, 0]
    assert missed_m.min() > 0.1
    np.testing.assert_allclose(tracker.missed_m(far, soles[:, 0]), missed_m, atol=5e-3)
    near = qpos[0].copy()
    tracker.solve(near, soles[:, 0])
    assert tracker.missed_m(near, soles[:, 0]).max() < 1e-4
    known = qpos[:1].copy()
    solver.solve(known, soles[:, :1])
    np.testing.assert_allclose(near, known[0], atol=2e-3)


def test_a_knee_is_never_stretched_through(humanoid):
    """A foot drawn beyond its reach and back again, time after time: near its place wherever it can be."""
    tracker = LegTracker(humanoid)
    base = humanoid.rest_qpos.copy()
    base[2] *= 0.955
    _, soles = motion(humanoid)
    sole = soles[:, 0].copy()
    start = sole[1, 0]
    for away_m in 0.3 * np.sin(np.arange(400) / 8.0):
        sole[1, 0] = start + away_m
        qpos = base.copy()
        tracker.solve(qpos, sole)
        reach_m = 0.21  # from where on the knee is straight
        assert tracker.missed_m(qpos, sole)[1] < (1e-3 if abs(away_m) < reach_m else 0.05)
