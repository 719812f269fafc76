"""What is kept of an evaluation is what happened in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra `policy` is not installed")

from expected_errors import refused
from training_room import training_room

from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.images import load_image_uint8
from r2sego_blender.policy.recorded_evaluation import recorded_evaluation
from r2sego_blender.policy.training import TEACHER, Task, evaluation_seeds
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.rollout_bodies import RobotBodies
from r2sego_blender.results.panels.rollout_list import POLICY, attempts, camera_poses, rollouts_folder, start_poses
from r2sego_blender.results.policy_evaluation import FILE, PolicyEvaluation, head_pictures


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return training_room(tmp_path_factory.mktemp("policy") / "room.r2s")


def test_an_episode_is_kept_as_it_was(room):
    bundle = Bundle.open(room)
    folder = rollouts_folder(bundle, POLICY)
    found = recorded_evaluation(Task(room), TEACHER, 1, 5, folder)
    told, (episode,) = PolicyEvaluation.load(folder), attempts(bundle, POLICY)
    assert (told.successes, told.episodes, told.low, told.high) == (found.successes, 1, found.low, found.high)
    assert told.mean_assist_n == found.mean_assist_n == episode.assist_n > 0.0
    told.require_of([episode.reason])
    # The same seed begins the same episode: there it stood, and that it saw.
    env = Task(room).environment()
    observation, info = env.reset(seed=evaluation_seeds(5, 1)[0])
    files = head_pictures(bundle, 0, episode.frames)
    assert len(files) == episode.frames > 20 and episode.time_s == pytest.approx(0.1 * (episode.frames - 1))
    np.testing.assert_array_equal(load_image_uint8(files[0]), observation["head"])
    np.testing.assert_allclose(start_poses(bundle, POLICY)[0], [*info["state"].base_xy_m, info["state"].yaw_rad])
    bodies = RobotBodies.load(bundle, POLICY)
    assert bodies.rate_hz == 10.0 and (bodies.camera.width, bodies.camera.height) == (128, 96)
    # Its camera stays on its body as that episode had mounted it, not as the robot's file says.
    parent = bodies.poses(0)[:, bodies.names.index(env.scene.robot.mount.parent)]
    mounted = np.linalg.inv(parent) @ camera_poses(bundle, POLICY, 0)
    np.testing.assert_allclose(mounted, np.broadcast_to(env.head_view.parent_from_camera, mounted.shape), atol=1e-9)
    assert np.abs(env.head_view.parent_from_camera - env.scene.robot.mount.parent_from_camera).max() > 1e-4


def test_a_folder_of_something_else_and_too_many_episodes_are_refused(room, tmp_path):
    own = tmp_path / "own.txt"
    own.write_text("a person's")
    with refused(SettingsError, tmp_path):
        recorded_evaluation(Task(room), TEACHER, 1, 0, tmp_path)
    with refused(SettingsError, "", "200"):
        recorded_evaluation(Task(room), TEACHER, 201, 0, tmp_path / "new")
    assert [*tmp_path.iterdir()] == [own] and FILE not in own.name


def test_what_a_person_keeps_beside_an_evaluation_is_not_replaced(room, tmp_path):
    for name in (FILE, "notes.md"):
        (tmp_path / name).write_text("{}")
    with refused(SettingsError, tmp_path / "notes.md"):
        recorded_evaluation(Task(room), TEACHER, 1, 0, tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted([FILE, "notes.md"])


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder that takes nothing from root either")
def test_a_folder_that_cannot_be_made_is_told_before_the_policy_is_looked_at(room, tmp_path):
    with refused(SettingsError, "/proc"):
        recorded_evaluation(Task(room), tmp_path / "no training", 1, 0, Path("/proc/new"))
