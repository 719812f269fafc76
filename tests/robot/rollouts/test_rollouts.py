"""Simulated rollouts: successes, failures with reasons, clear errors, the same bits again."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.walk_to import WalkTo
from r2sego_blender.robot.planning.free_floor import free_floor
from r2sego_blender.robot.rollouts.candidates import candidate_stream
from r2sego_blender.robot.rollouts.rollout import load_rollouts, save_rollouts
from r2sego_blender.robot.rollouts.rollouts import Rollout, successful_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope, Episode, Failures, Start

SCOPE = BehaviourScope.load("walk_and_look")
FEW = RolloutSettings(successes=5, max_attempts=15)
SHORT = replace(SCOPE, episode=Episode(duration_s=2.0), walk_to=WalkTo(distance_m=(0.1, 1.0)))


@pytest.fixture(scope="module")
def rollouts(humanoid, box_room) -> tuple[Rollout, ...]:
    return successful_rollouts(humanoid, SCOPE, box_room(), FEW, seed=3)


def test_enough_succeed_and_the_last_one_does(rollouts):
    assert sum(rollout.success for rollout in rollouts) == 5
    assert rollouts[-1].success
    for rollout in rollouts:
        assert rollout.success == (rollout.reason == "")
        assert rollout.frame == len(rollout.qpos) - 1 == len(rollout.camera_poses) - 1
        np.testing.assert_allclose(np.diff(rollout.times_s), 1.0 / SCOPE.episode.camera_rate_hz, atol=0.004)
        if rollout.success:
            assert rollout.times_s[-1] == pytest.approx(8.0)
            assert len(rollout.qpos) == 8.0 * SCOPE.episode.camera_rate_hz + 1


def test_successes_stay_upright_in_the_region(rollouts, humanoid, box_room, distance_to_obstacles):
    floor = free_floor(humanoid, SCOPE, box_room())
    for rollout in rollouts:
        if rollout.success:
            assert floor.in_region(rollout.qpos[:, :2]).all()
            assert distance_to_obstacles(rollout.qpos[:, :2]).min() > 0.2
            assert rollout.qpos[:, 2].min() > 0.65
            np.testing.assert_array_less(np.abs(rollout.qpos[:, 4:6]), 0.05)


def test_camera_poses_are_rigid_and_look_down_as_declared(rollouts, humanoid):
    poses = candidate_stream(rollouts).poses
    rotation = poses[:, :3, :3]
    np.testing.assert_allclose(
        rotation.transpose(0, 2, 1) @ rotation, np.tile(np.eye(3), (len(poses), 1, 1)), atol=1e-9
    )
    assert (np.linalg.det(rotation) > 0.99).all()
    down_deg = np.degrees(np.arcsin(-poses[:, 2, 2]))
    assert down_deg.min() > 22.0 - 4.0 - 4.0
    assert down_deg.max() < 46.0 + 6.0 + 4.0
    assert ((poses[:, 2, 3] > 1.15) & (poses[:, 2, 3] < 1.30)).all()
    assert (np.abs(poses[:, 2, 0]) < 0.1).all()  # level: the image's x axis is horizontal
    first = next(rollout for rollout in rollouts if rollout.success)
    unpitched = humanoid.camera_poses(first.qpos)
    np.testing.assert_allclose(unpitched[:, :3, 3], first.camera_poses[:, :3, 3], atol=1e-12)


def test_candidates_index_the_accepted_rollouts(rollouts):
    candidates = candidate_stream(rollouts)
    accepted = [rollout for rollout in rollouts if rollout.success]
    assert len(candidates) == sum(len(rollout.qpos) for rollout in accepted)
    for index in (0, 100, len(candidates) - 1):
        rollout, frame = candidates.rollout[index], candidates.frame[index]
        np.testing.assert_array_equal(candidates.poses[index], accepted[rollout].camera_poses[frame])
    assert len(candidate_stream(())) == 0


def test_ego_camera_sees_what_lies_ahead(rollouts, humanoid):
    lens = humanoid.camera(640, 480)
    for pose in candidate_stream(rollouts).poses[::40]:
        camera = lens.at(pose)
        ahead = camera.centre + 1.5 * camera.forward
        pixel, depth = camera.project(ahead)
        assert camera.sees(pixel, depth)
        np.testing.assert_allclose(pixel, (320.0, 240.0), atol=1e-6)


def test_same_seed_same_bits(humanoid, box_room):
    settings = RolloutSettings(successes=2)
    first = successful_rollouts(humanoid, SHORT, box_room(), settings, seed=1)
    again = successful_rollouts(humanoid, SHORT, box_room(), settings, seed=1)
    more = successful_rollouts(humanoid, SHORT, box_room(), RolloutSettings(successes=3), seed=1)
    for one, other, longer in zip(first, again, more, strict=False):
        np.testing.assert_array_equal(one.qpos, other.qpos)
        np.testing.assert_array_equal(one.camera_poses, other.camera_poses)
        np.testing.assert_array_equal(one.qpos, longer.qpos)
    different = successful_rollouts(humanoid, SHORT, box_room(), settings, seed=2)
    assert not np.array_equal(first[0].qpos, different[0].qpos)


def test_without_the_tracking_wrench_the_robot_falls(humanoid, box_room):
    """Balance is the wrench's: gravity and contact are real."""
    unaided = RolloutSettings(successes=1, max_attempts=3, max_force_n=1e-3, max_torque_nm=1e-3)
    scope = replace(SHORT, episode=Episode(duration_s=4.0), failures=Failures(joint_limit_deg=90.0))
    with pytest.raises(RobotError, match=r"scene\.xml: only 0 of 1 rollouts .*3 attempts; .*(fall|contact)"):
        successful_rollouts(humanoid, scope, box_room(), unaided, seed=0)


def test_what_the_planner_does_not_know_ends_in_body_contact(humanoid, box_room, monkeypatch):
    """Studs that its free floor leaves out catch the swinging feet."""
    grid = np.arange(-1.9, 1.9, 0.2) + 0.025
    studs = [(x, y, 0.01, 0.01, 0.026) for x in grid for y in grid[1:-1]]
    scene = box_room(studs)
    settings = RolloutSettings(successes=1, max_attempts=4)
    scope = replace(SCOPE, walk_to=WalkTo(distance_m=(1.0, 3.0)))
    without_studs = free_floor(humanoid, scope, box_room(()))
    monkeypatch.setattr("r2sego_blender.robot.rollouts.rollouts.free_floor", lambda *_: without_studs)
    with pytest.raises(RobotError, match=r"body_contact \(\w+ankle_\w+_link touched box\d+\)"):
        successful_rollouts(humanoid, scope, scene, settings, seed=0)


def test_failures_carry_reason_and_frame(humanoid, box_room, tmp_path):
    # Walks that begin with their back to the goal do not end in time.
    hasty = replace(
        SCOPE,
        episode=Episode(duration_s=3.0),
        start=Start(heading_offset_deg=(-180.0, 180.0)),
        walk_to=WalkTo(distance_m=(0.8, 1.6)),
    )
    settings = RolloutSettings(successes=4, max_attempts=40)
    attempts = successful_rollouts(humanoid, hasty, box_room(), settings, seed=0)
    failed = [attempt for attempt in attempts if not attempt.success]
    assert "time_out" in {attempt.reason for attempt in failed}
    for attempt in failed:
        assert attempt.reason in {"time_out", "no_goal", "joint_limit"}
        assert attempt.detail
        assert attempt.frame == max(0, len(attempt.qpos) - 1)
        assert np.isfinite(attempt.qpos).all()
    save_rollouts(tmp_path, attempts)
    for loaded, attempt in zip(load_rollouts(tmp_path), attempts, strict=True):
        assert replace(loaded, qpos=0, times_s=0, camera_poses=0) == replace(attempt, qpos=0, times_s=0, camera_poses=0)
        np.testing.assert_array_equal(loaded.camera_poses, attempt.camera_poses)


def test_too_small_a_room_names_the_reason(humanoid, box_room):
    far = replace(SCOPE, walk_to=WalkTo(distance_m=(3.0, 4.0)), behaviours=replace(SCOPE.behaviours, look_around=0.0))
    slow = replace(far, episode=Episode(duration_s=1.0))
    with pytest.raises(RobotError, match=r"4 failed by no_goal \(no reachable place.*shorter walk_to"):
        successful_rollouts(humanoid, slow, box_room(), RolloutSettings(max_attempts=4), seed=0)


def test_broken_scene_and_broken_record(humanoid, tmp_path):
    with pytest.raises(RobotError, match="no such collision scene"):
        successful_rollouts(humanoid, SCOPE, tmp_path / "scene.xml", FEW, seed=0)
    (tmp_path / "scene.xml").write_text("<mujoco><worldbody><geom/></worldbody></mujoco>")
    with pytest.raises(RobotError, match="collision scene does not compile"):
        successful_rollouts(humanoid, SCOPE, tmp_path / "scene.xml", FEW, seed=0)
    (tmp_path / "rollouts.json").write_text("{}")
    with pytest.raises(RobotError, match=r"rollouts\.json: these rollouts cannot be read"):
        load_rollouts(tmp_path)


def test_rollouts_whose_frames_do_not_belong_together_are_named(tmp_path):
    frames = {"times_s": np.arange(3.0), "camera_poses": np.tile(np.eye(4), (3, 1, 1))}
    short = Rollout(True, "", 2, np.eye(1, 7, 3).repeat(2, 0), **frames, seed=(0, 0))
    save_rollouts(tmp_path, [short])
    with pytest.raises(RobotError, match=r"rollouts\.npz: these rollouts cannot be read"):
        load_rollouts(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("behaviour", None),
        ("frame", [4]),
        ("controller", 7),
        ("success", "yes"),
        ("quality", {"foot_slide_m": "far"}),
        ("quality", {"camera_height_m": 1.4}),
        ("quality", {"camera_pitch_deg": ["low", "high"]}),
        ("quality", {"camera_pitch_deg": [1.0]}),
        ("quality", {"camera_pitch_deg": [0.0, "inf"]}),
        ("quality", {"assist_n": "nan"}),
    ],
)
def test_words_of_another_kind_are_named(tmp_path, name, value):
    frames = {"times_s": np.arange(3.0), "camera_poses": np.tile(np.eye(4), (3, 1, 1))}
    rollout = Rollout(True, "", 2, np.eye(1, 7, 3).repeat(3, 0), **frames, seed=(0, 0))
    save_rollouts(tmp_path, [rollout])
    (loaded,) = load_rollouts(tmp_path)
    assert loaded.quality == rollout.quality and loaded.seed == rollout.seed
    told = json.loads((tmp_path / "rollouts.json").read_text())
    told["rollouts"][0][name] = value
    (tmp_path / "rollouts.json").write_text(json.dumps(told))
    with pytest.raises(RobotError, match=r"rollouts\.json: these rollouts cannot be read"):
        load_rollouts(tmp_path)


def test_real_g1_rolls_out(box_room, shared_robot):
    from r2sego_blender.robot.model.model import RobotModel

    mount = ["torso_link", [0.0576235, 0.01753, 0.42987], [0.0, 0.8307767, 0.0], {"hfov_deg": 69.0}]
    robot = RobotModel.load(shared_robot("g1/unitree_mujoco_g1/g1_29dof.xml"), mount)
    rollouts = successful_rollouts(robot, SHORT, box_room(), RolloutSettings(successes=1), seed=0)
    assert rollouts[-1].success
