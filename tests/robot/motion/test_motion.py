"""Reference motions: bounded roots, planted feet, legs that reach them, joints in their limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from r2sego_blender.robot.behaviours.trajectory import RATE_HZ, RootTrajectory
from r2sego_blender.robot.motion.motion import plan_motion
from r2sego_blender.robot.planning.course import plan_root
from r2sego_blender.robot.planning.free_floor import FreeFloor, free_floor
from r2sego_blender.robot.scope.scope import BehaviourScope

SCOPE = BehaviourScope.load("walk_and_look")
SEEDS = range(12)


@pytest.fixture(scope="module")
def floor(humanoid, box_room) -> FreeFloor:
    return free_floor(humanoid, SCOPE, box_room())


@pytest.fixture(scope="module")
def roots(floor) -> list[RootTrajectory]:
    return [plan_root(floor, SCOPE, np.random.default_rng(seed)) for seed in SEEDS]


def test_roots_keep_the_scope_s_bounds(roots, floor):
    assert {root.behaviour for root in roots} == {"walk_to", "look_around"}
    for root in roots:
        velocity = np.diff(root.xy, axis=0) * RATE_HZ
        assert np.linalg.norm(velocity, axis=1).max() <= SCOPE.walk_to.speed_m_s[1] + 1e-9
        assert np.abs(np.diff(root.yaw)).max() * RATE_HZ <= math.radians(90.0) + 1e-9
        assert np.abs(np.diff(root.speed)).max() * RATE_HZ <= 0.7 + 1e-9
        heading = np.stack([np.cos(root.yaw), np.sin(root.yaw)], axis=1)[:-1]
        np.testing.assert_allclose((velocity * heading).sum(axis=1), root.speed[:-1], atol=2e-2)
        assert floor.in_region(root.xy).all()


def test_roots_arrive(roots):
    walks = [root for root in roots if root.behaviour == "walk_to"]
    missed_m = [math.dist(root.xy[-1], root.goal) for root in walks]
    assert np.median(missed_m) < 0.05
    assert all(math.dist(root.xy[0], root.goal) > 0.3 for root in walks)
    for root in roots:
        if root.behaviour == "look_around":
            np.testing.assert_array_equal(root.xy, np.broadcast_to(root.xy[0], root.xy.shape))


def test_motion_keeps_limits_floor_and_look(humanoid, floor):
    model = humanoid.model
    waist = model.jnt_qposadr[humanoid.waist_yaw]
    yaws = []
    for seed in SEEDS:
        motion = plan_motion(humanoid, floor, SCOPE, np.random.default_rng(seed))
        angles = motion.qpos[:, model.jnt_qposadr[1:]]
        assert (angles >= model.jnt_range[1:, 0]).all()
        assert (angles <= model.jnt_range[1:, 1]).all()
        assert np.abs(np.diff(angles, axis=0)).max() * RATE_HZ < 12.0
        yaws.append(motion.qpos[:, waist])
        assert 22.0 - 1e-9 <= motion.mount.pitch_down_deg <= 46.0 + 1e-9
    yaws = np.degrees(yaws)
    assert np.abs(yaws).max() <= 45.0 + 1e-9
    assert yaws.max() > 30.0
    assert yaws.min() < -30.0


def test_standing_needs_no_help(humanoid, floor):
    """Inverse dynamics: at rest the feet carry the body, and the residual wrench is nothing."""
    seed = next(s for s in SEEDS if _behaviour(floor, s) == "look_around")
    motion = plan_motion(humanoid, floor, SCOPE, np.random.default_rng(seed))
    still = np.abs(motion.qvel).max(axis=1) < 0.02
    assert still.any()
    assert np.abs(motion.torque[still, :3]).max() < 1e-6
    assert np.abs(motion.torque[still, 3:6]).max() < 5.0
    efforts = model_efforts(humanoid)
    assert (np.abs(motion.torque[:, 6:]) < efforts).all()


def model_efforts(humanoid) -> np.ndarray:
    return humanoid.model.actuator_forcerange[:, 1]


def _behaviour(floor: FreeFloor, seed: int) -> str:
    return plan_root(floor, SCOPE, np.random.default_rng(seed)).behaviour
