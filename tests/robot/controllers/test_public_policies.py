"""The public policies: they walk, squat and cross a furnished room as measured elsewhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from policy_controllers import SCOPE, controller, only
from tiny_policies import trusted

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.robot.controllers.policy_observation import Command
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.attempts import Attempts
from r2sego_blender.robot.rollouts.rollout import Rollout
from r2sego_blender.robot.scope.scope import Control, Failures

G1 = "g1/unitree_mujoco_g1/g1_29dof.xml"
G1_MOUNT = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]
H1_MOUNT = ["pelvis", [0.10848, 0.0325, 0.69317], [0.0, 0.8, 0.0], {"hfov_deg": 69.0}]
RL_LAB = ("g1/policies/rl_lab_velocity.onnx", "unitree_rl_lab_g1_29dof")
FALCON = ("g1/policies/falcon_g1.onnx", "falcon_g1_29dof")


@pytest.fixture(scope="module")
def g1(shared_robot) -> RobotModel:
    return RobotModel.load(shared_robot(G1), G1_MOUNT)


class Told:
    """A pursuit that says the same all the time, or what ``command`` says."""

    def __init__(self, command) -> None:
        self._command, self._time_s = command, 0.0

    def command(self, qpos: np.ndarray, period_s: float) -> Command:
        self._time_s += period_s
        return self._command(self._time_s) if callable(self._command) else self._command


def walked(robot: RobotModel, policy: Path, layout: str, command, seconds: float, folder: Path) -> np.ndarray:
    """(T, 7) the base's poses, each step, of a robot on a wide floor that is told ``command``."""
    scene = folder / "floor.xml"
    scene.write_text('<mujoco><worldbody><geom type="box" pos="0 0 -0.05" size="9 9 0.05"/></worldbody></mujoco>')
    scope = replace(SCOPE, region=replace(SCOPE.region, within=((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))))
    made = controller(robot, scene, policy, layout, scope)
    drawn = made.draw(np.random.default_rng(0))
    drawn._pursuit = Told(command)
    data = mujoco.MjData(made.composition.model)
    data.qpos[:] = drawn.qpos
    data.qpos[:2], data.qpos[3:7] = 0.0, (1.0, 0.0, 0.0, 0.0)
    poses = []
    for step in range(round(seconds / made.composition.model.opt.timestep)):
        drawn.apply(data, step)
        mujoco.mj_step(made.composition.model, data)
        poses.append(data.qpos[:7].copy())
    return np.array(poses)


def tilt_deg(poses: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(1.0 - 2.0 * (poses[:, 4] ** 2 + poses[:, 5] ** 2)))


def test_the_29_joint_policy_walks_as_measured_elsewhere(g1, shared_robot, tmp_path):
    """shared/robots/README.md: 4.69 m in 10 s at 0.5 m/s, tilted by 2.2 degrees at most."""
    poses = walked(g1, shared_robot(RL_LAB[0]), RL_LAB[1], Command(0.5, 0.0, 0.0, True), 10.0, tmp_path)
    assert np.linalg.norm(poses[-1, :2]) == pytest.approx(4.69, abs=0.1)
    assert tilt_deg(poses).max() < 2.5


@pytest.mark.parametrize(
    ("robot", "mount", "policy", "layout"),
    [
        (G1, G1_MOUNT, "g1/policies/rl_gym_g1_12dof.pt", "unitree_rl_gym_g1_12dof"),
        ("h1/h1/h1.xml", H1_MOUNT, "h1/motion.pt", "unitree_rl_gym_h1"),
        (G1, G1_MOUNT, *FALCON),
    ],
)
def test_public_policies_walk(robot, mount, policy, layout, shared_robot, tmp_path):
    model = RobotModel.load(shared_robot(robot), mount)
    poses = walked(model, trusted(shared_robot(policy)), layout, Command(0.5, 0.0, 0.0, True, 0.75), 6.0, tmp_path)
    assert 2.0 < np.linalg.norm(poses[-1, :2]) < 3.4
    assert tilt_deg(poses).max() < 12.0
    assert poses[:, 2].min() > 0.85 * poses[0, 2]


def test_the_height_command_squats(g1, shared_robot, tmp_path):
    def lower(time_s: float) -> Command:
        return Command(base_height_m=max(0.55, 0.75 - 0.2 * max(0.0, time_s - 1.0)))

    poses = walked(g1, shared_robot(FALCON[0]), FALCON[1], lower, 5.0, tmp_path)
    assert poses[-200:, 2] == pytest.approx(0.555, abs=0.03)
    assert np.linalg.norm(poses[-1, :2]) < 0.3
    assert tilt_deg(poses).max() < 12.0


def rollouts(robot, scene, policy, layout, scope, count, planned_in=None) -> list[Rollout]:
    scope = replace(scope, controller=Control(kind="policy", file=str(policy), layout=layout))
    floor = free_floor(robot, scope, planned_in or scene)
    attempts = Attempts(robot.source, robot.mount, scope, floor, scene, RolloutSettings(), 5)
    return [attempts.run(number) for number in range(count)]


@pytest.mark.slow
def test_twelve_walks_of_the_29_joint_policy_in_a_furnished_room(g1, shared_robot, box_room):
    found = rollouts(g1, box_room(), shared_robot(RL_LAB[0]), RL_LAB[1], only(SCOPE, walk_to=1.0), 14)
    succeeded = [rollout for rollout in found if rollout.success]
    assert len(succeeded) >= 12
    for rollout in succeeded:
        assert rollout.controller == "policy rl_lab_velocity.onnx"
        assert rollout.quality.foot_slide_m < 0.03
        assert rollout.quality.assist_n == 0.0
        assert np.linalg.norm(rollout.qpos[-1, :2] - rollout.qpos[0, :2]) > 0.3
        assert (rollout.qpos[:, 2] > 0.7).all()


def test_what_the_planner_does_not_know_is_a_bump_with_its_frame(g1, shared_robot, box_room):
    """Studs that its free floor leaves out catch the walking feet."""
    grid = np.arange(-1.9, 1.9, 0.2) + 0.025
    studs = box_room([(x, y, 0.01, 0.01, 0.026) for x in grid for y in grid[1:-1]])
    walks = only(SCOPE, walk_to=1.0)
    for rollout in rollouts(g1, studs, shared_robot(RL_LAB[0]), RL_LAB[1], walks, 3, planned_in=box_room(())):
        assert rollout.reason in {"body_contact", "fall"}
        assert rollout.detail
        assert rollout.frame == len(rollout.qpos) - 1 < SCOPE.episode.duration_s * SCOPE.episode.camera_rate_hz


def test_squats_in_a_room(g1, shared_robot, box_room):
    scope = replace(only(SCOPE, squat=1.0), failures=Failures(penetration_m=0.03, slide_m=0.05))
    (rollout,) = rollouts(g1, box_room(), shared_robot(FALCON[0]), FALCON[1], scope, 1)
    assert rollout.success and rollout.behaviour == "squat"
    low, high = (share * g1.rest_height_m for share in scope.squat.height)
    assert max(low, 0.5) - 0.02 < rollout.qpos[:, 2].min() < high + 0.02
    assert rollout.qpos[:, 2].max() > 0.72
