"""A student in a rollout is given what its environment gives it, to the bit, and sees the asset that it is given."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from expected_errors import refused
from seeing_networks import seeing_network

from r2sego_blender.core.errors import RobotError
from r2sego_blender.refine.head_sight import HeadSight
from r2sego_blender.robot.behaviours.trajectory import STAND_OFF_M
from r2sego_blender.robot.controllers.controller import check_controller, make_controller
from r2sego_blender.robot.controllers.drive_actions import proprioception_size
from r2sego_blender.robot.controllers.seeing_policy import HEAD_PICTURE, SeeingPolicyFile
from r2sego_blender.robot.controllers.student import StudentDrive
from r2sego_blender.robot.rollouts.attempts import Attempts
from r2sego_blender.robot.rollouts.failures import Judge
from r2sego_blender.robot.rollouts.simulation import simulate
from r2sego_blender.robot.scope.scope import Behaviours, Control, Episode
from r2sego_blender.splats.formats.registry import load_asset

pytest.importorskip("gymnasium", reason="make install POLICY=1")
pytest.importorskip("onnx", reason="make install POLICY=1")

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.policy.environment.environments import SitEnv
from r2sego_blender.policy.environment.episode import PHYSICS_S
from r2sego_blender.policy.environment.randomization import Randomization
from r2sego_blender.policy.environment.training_scene import TrainingScene

SECONDS, PROPRIO = 1.5, proprioception_size(29)
AS_IT_IS = Randomization(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (0.1, 0.1), (1.0, 1.0), (1.0, 1.0))
"""Nothing drawn, and pictures as old as a rollout's."""


@pytest.fixture(scope="module")
def scene(bundle) -> TrainingScene:
    return TrainingScene.open(bundle, sits=True)


@pytest.fixture(scope="module")
def asset(bundle):
    return load_asset(Scene.open(bundle).asset_file)


@pytest.fixture(scope="module")
def student(tmp_path_factory):
    return seeing_network(tmp_path_factory.mktemp("student") / "student.onnx", PROPRIO)


def attempts(scene: TrainingScene, file, asset) -> Attempts:
    control, episode = Control(kind="student", file=str(file)), Episode(duration_s=SECONDS, camera_rate_hz=10.0)
    scope, robot = replace(scene.scope, controller=control, episode=episode), scene.robot
    sight = None if asset is None else HeadSight(asset, robot.source, robot.mount)
    settings = replace(scene.settings, step_s=PHYSICS_S)
    return Attempts(robot.source, robot.mount, scope, scene.floor, scene.collision_mjcf, settings, 1, sight)


def test_a_rollout_is_the_environments_episode_to_the_bit(bundle, scene, student, asset):
    rollout = attempts(scene, student, asset).run(0)
    assert len(rollout.qpos) == round(SECONDS * 10.0) + 1 and rollout.controller == f"student {student.name}"
    env = SitEnv(bundle, randomization=AS_IT_IS)
    x, y = rollout.qpos[0, :2]
    yaw = 2.0 * np.arctan2(rollout.qpos[0, 6], rollout.qpos[0, 3])
    observed, _ = env.reset(seed=0, options={"start": (x, y, yaw)})
    act = SeeingPolicyFile(student, HEAD_PICTURE, PROPRIO, 4).start()
    episode = [env._episode.data.qpos.copy()]
    for _ in range(len(rollout.qpos) - 1):
        observed, *_ = env.step(act(observed["head"], observed["proprio"]))
        episode.append(env._episode.data.qpos.copy())
    assert np.abs(episode[-1][:7] - episode[0][:7]).max() > 0.02  # it does move
    np.testing.assert_allclose(rollout.qpos, episode, rtol=0.0, atol=1e-9)


def test_the_same_twice_and_another_where_it_sees_another_asset(scene, student, asset):
    first = attempts(scene, student, asset).run(3)
    again = pickle.loads(pickle.dumps(attempts(scene, student, asset))).run(3)
    dark = replace(asset, sh=asset.sh - 0.5)
    other = attempts(scene, student, dark).run(3)
    assert first.qpos.tobytes() == again.qpos.tobytes() and first.camera_poses.tobytes() == again.camera_poses.tobytes()
    assert np.array_equal(first.qpos[0], other.qpos[0]) and not np.array_equal(first.qpos[-1], other.qpos[-1])
    assert first.quality.assist_n > 0.0


def test_who_has_sat_long_enough_is_done(scene, asset, tmp_path):
    told = attempts(scene, seeing_network(tmp_path / "sits.onnx", PROPRIO, (0.0, 0.0, 0.0, 9.0)), asset)
    scope = replace(told.scope, episode=Episode(duration_s=15.0), sit_on=replace(told.scope.sit_on, hold_s=0.5))
    settings = replace(told.settings, step_s=0.004)
    made = make_controller(scene.robot, told.floor, scope, told.collision_mjcf, settings, told.sight)
    seat = made.draw(np.random.default_rng(0)).seat
    drive = StudentDrive(made, seat.ahead(STAND_OFF_M), seat.yaw_rad, seat)
    judge = Judge(made.composition, told.floor, scope, scene.robot.rest_height_m)
    done = simulate(made.composition, drive, judge, 10.0)
    assert not done.reason and done.meter.seated_s >= 0.5
    assert 1.0 < done.times_s[-1] < 10.0


def test_what_cannot_be_a_student_is_refused(scene, student, asset, tmp_path):
    robot = scene.robot

    def checked(file, **behaviours) -> None:
        weights = Behaviours(**({"walk_to": 0.0, "look_around": 0.0, "sit_on": 1.0} | behaviours))
        scope = replace(scene.scope, controller=Control(kind="student", file=str(file)), behaviours=weights)
        check_controller(robot, scope)

    checked(student)
    with refused(RobotError, scene.scope.name, "walk_to"):
        checked(student, walk_to=0.5)
    with refused(RobotError, scene.scope.name, "controller.file"):
        checked("")
    others = {"felt": (PROPRIO + 1, HEAD_PICTURE), "seen": (PROPRIO, (48, 64, 3))}
    for name, (proprio, picture) in others.items():
        other = seeing_network(tmp_path / f"{name}.onnx", proprio, picture=picture)
        with refused(RobotError, other):
            checked(other)
    with refused(RobotError, tmp_path / "gone.onnx"):
        checked(tmp_path / "gone.onnx")
    blind = attempts(scene, student, None)
    with refused(RobotError, scene.scope.name, "visual asset"):
        make_controller(robot, blind.floor, blind.scope, blind.collision_mjcf, blind.settings)
