"""A recorded evaluation is read as it was written, or refused."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import fake_policy_evaluation
import numpy as np
import pytest
from expected_errors import refused
from fake_policy_evaluation import EVALUATION, FRAMES, head_level
from fake_rollouts import ROBOT, rollouts

from r2sego_blender.core.errors import SceneError
from r2sego_blender.core.images import load_image_uint8
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.rollout_list import POLICY, attempts, rollouts_folder, start_poses
from r2sego_blender.results.policy_evaluation import (
    FILE,
    POLICY_EVALUATION,
    PolicyEvaluation,
    head_pictures,
    is_recorded,
)
from r2sego_blender.robot.model.model import RobotModel
from r2sego_blender.robot.rollouts.rollout import Quality, save_rollouts


@pytest.fixture
def copied(bundle_path, tmp_path):
    shutil.copytree(bundle_path, tmp_path / "room.r2s")
    return Bundle.open(tmp_path / "room.r2s")


def test_what_was_written_is_read(bundle):
    read = bundle.read(POLICY_EVALUATION)
    assert read == EVALUATION and is_recorded(bundle)
    assert list(read.by_end.items()) == [("", 1), ("body_contact", 1), ("no_goal", 1)]
    assert read.policy_name == replace(read, policy="C:\\trainings\\student\\").policy_name == "student"
    read.require_of(one.reason for one in attempts(bundle, POLICY))


@pytest.mark.parametrize("ends", [[], ["", "", "body_contact"], ["", "no_goal", "body_contact", ""]])
def test_an_evaluation_of_other_episodes_is_refused(ends):
    with refused(SceneError, FILE):
        EVALUATION.require_of(ends)


@pytest.mark.parametrize(
    "changed",
    [
        {"successes": 2},
        {"successes": True},
        {"successes": -1, "episodes": 1},
        {"episodes": 0, "successes": 0, "failures": {}},
        {"low": 0.5},
        {"high": 0.2},
        {"high": 1.5},
        {"mean_assist_n": -1.0},
        {"policy": 3},
        {"chairs": [1]},
        {"failures": {"fall": "two"}},
        {"failures": []},
    ],
)
def test_numbers_that_do_not_fit_together_are_refused(tmp_path, changed):
    EVALUATION.save(tmp_path)
    file = tmp_path / FILE
    file.write_text(json.dumps(json.loads(file.read_text()) | changed))
    with refused(SceneError, file):
        PolicyEvaluation.load(tmp_path)


def test_all_or_no_success_has_an_interval_that_touches_its_end(tmp_path):
    for successes, low, high in ((0, 0.0, 0.7076), (3, 0.2924, 1.0)):
        failures = {"fall": 3 - successes} if successes < 3 else {}
        told = replace(EVALUATION, successes=successes, failures=failures, low=low, high=high)
        told.save(tmp_path)
        assert PolicyEvaluation.load(tmp_path) == told


def test_the_heads_pictures_are_a_file_a_frame_or_none(copied):
    for number in fake_policy_evaluation.PICTURED:
        files = head_pictures(copied, number, FRAMES[number])
        assert [load_image_uint8(file)[0, 0, 0] for file in files] == [
            head_level(number, frame) for frame in range(FRAMES[number])
        ]
    assert head_pictures(copied, 2, FRAMES[2]) == []
    files[3].unlink()
    with refused(SceneError, files[3]):
        head_pictures(copied, 1, FRAMES[1])


def test_starts_are_where_the_first_frame_stands_and_faces(copied):
    robot = RobotModel.load(ROBOT)
    starts = np.array([[0.5, -1.0, 3.0], [2.0, 0.25, -1.2], [0.0, 0.0, 0.4]])
    made = []
    for told, (x, y, yaw) in zip(rollouts(robot, (3, 2, 2)), starts, strict=True):
        told.qpos[0, :2], told.qpos[0, 3:7] = (x, y), (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2))
        made.append(replace(told, quality=Quality(assist_n=10.0 * yaw)))
    save_rollouts(rollouts_folder(copied, POLICY), made)
    np.testing.assert_allclose(start_poses(copied, POLICY), starts, atol=1e-9)
    assert [one.assist_n for one in attempts(copied, POLICY)] == [10.0 * yaw for yaw in starts[:, 2]]
    save_rollouts(rollouts_folder(copied, POLICY), rollouts(robot, (3, 0)))
    assert np.isnan(start_poses(copied, POLICY)).tolist() == [[False] * 3, [True] * 3]
