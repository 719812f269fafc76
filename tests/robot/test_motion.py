"""Reference motions: bounded roots, planted feet, legs that reach them, joints in their limits."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from r2sego_blender.robot.behaviours import RootTrajectory, plan_root
from r2sego_blender.robot.free_floor import FreeFloor, free_floor
from r2sego_blender.robot.gait import plan_gait
from r2sego_blender.robot.kinematics import LegSolver
from r2sego_blender.robot.motion import plan_motion
from r2sego_blender.robot.navigation import RATE_HZ
from r2sego_blender.robot.scope import BehaviourScope

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


def test_loaded_feet_do_not_slide_and_swings_clear(roots):
    offsets = np.array([[0.0, 0.12], [0.0, -0.12]])
    for root in roots:
        gait = plan_gait(root, offsets)
        np.testing.assert_allclose(gait.load.sum(axis=0), 1.0)
        assert (gait.load >= 0.0).all()
        assert (gait.feet[..., 2] >= 0.0).all()
        for foot in range(2):
            on_floor = gait.feet[foot, :, 2] < 1e-9
            both = on_floor[1:] & on_floor[:-1]
            slide = np.abs(np.diff(gait.feet[foot], axis=0))[both]
            assert slide.max() < 2e-3
            swinging = gait.feet[foot, :, 2] > 0.01
            assert gait.load[foot][swinging].max() < 1e-9
        # Some foot is always down, and each stays below the body.
        assert (gait.feet[..., 2].min(axis=0) < 1e-9).all()
        assert np.linalg.norm(gait.feet[..., :2] - root.xy, axis=-1).max() < 0.45


def test_legs_reach_their_feet(humanoid):
    rng = np.random.default_rng(1)
    qpos = np.tile(humanoid.rest_qpos, (30, 1))
    qpos[:, 2] -= 0.04
    soles = np.empty((2, 30, 4))
    soles[..., 0] = rng.uniform(-0.12, 0.12, (2, 30))
    soles[0, :, 1], soles[1, :, 1] = rng.uniform(0.08, 0.16, (2, 30)) * [[1.0], [-1.0]]
    soles[..., 2] = humanoid.legs[0].sole_m + rng.uniform(0.0, 0.05, (2, 30))
    soles[..., 3] = rng.uniform(-0.2, 0.2, (2, 30))
    LegSolver(humanoid).solve(qpos, soles)
    data = mujoco.MjData(humanoid.model)
    for frame in range(30):
        data.qpos[:] = qpos[frame]
        mujoco.mj_kinematics(humanoid.model, data)
        for leg, target in zip(humanoid.legs, soles[:, frame], strict=True):
            np.testing.assert_allclose(data.xpos[leg.foot], target[:3], atol=1e-3)
            axes = data.xmat[leg.foot].reshape(3, 3)
            assert math.atan2(axes[1, 0], axes[0, 0]) == pytest.approx(target[3], abs=1e-2)
            assert axes[2, 2] > 1.0 - 1e-4


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
