"""What `r2sego rollouts` says: every attempt with its outcome, and what fails how often."""

import json

import numpy as np
import pytest
from bundles import new_bundle

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import RobotError
from r2sego_blender.results.rollouts_report import describe_rollouts, lines
from r2sego_blender.robot.rollouts.rollout import Quality, Rollout, save_rollouts


def attempt(number, frames, reason="", detail="", height=(1.2, 1.3), pitch=(20.0, 40.0)):
    return Rollout(
        success=not reason,
        reason=reason,
        frame=max(frames - 1, 0),
        qpos=np.eye(1, 7, 3).repeat(frames, 0),
        times_s=np.arange(frames) / 5.0,
        camera_poses=np.tile(np.eye(4), (frames, 1, 1)),
        seed=(3, number),
        behaviour="walk_to" if frames else "",
        detail=detail,
        controller="reference motions",
        quality=Quality(foot_slide_m=0.004, camera_height_m=height, camera_pitch_deg=pitch),
    )


@pytest.fixture
def scene(tmp_path) -> Scene:
    overrides = {"rollouts.successes": 2, "selection.ranking": "random"}
    scene = new_bundle(
        tmp_path / "room.r2s", lambda f: (f / "rounds/0/rollouts").mkdir(parents=True), overrides=overrides
    )
    attempts = [
        attempt(0, 41),
        attempt(1, 13, "body_contact", "left_hand touched table", height=(0.5, 1.9), pitch=(-10.0, 80.0)),
        attempt(2, 0, "no_goal", "no reachable place lies in the scope's ranges"),
        attempt(3, 9, "body_contact", "torso touched wall"),
        attempt(4, 31, height=(1.1, 1.25), pitch=(25.0, 48.0)),
    ]
    save_rollouts(scene.path / "rounds/0/rollouts", attempts)
    return scene


def test_the_figures_are_those_of_the_attempts(scene):
    described = json.loads(json.dumps(describe_rollouts(scene, 0)))
    assert (described["succeeded"], described["wanted"], described["attempts"]) == (2, 2, 5)
    assert described["failures"] == {"body_contact": 2, "no_goal": 1}
    assert described["candidates"] == 41 + 31
    assert described["camera_height_m"] == [1.1, 1.3]  # of the successful ones
    assert described["camera_pitch_deg"] == [20.0, 48.0]
    assert [a["frame"] for a in described["rollouts"]] == [40, 12, 0, 8, 30]
    assert [a["time_s"] for a in described["rollouts"]] == pytest.approx([8.0, 2.4, 0.0, 1.6, 6.0])
    assert described["rollouts"][1]["detail"] == "left_hand touched table"
    assert described["rollouts"][4]["seed"] == [3, 4]
    assert described["ablations"] == ["selection.ranking = random"]


def test_a_person_reads_reason_frame_and_particulars(scene):
    text = lines(describe_rollouts(scene, 0))
    assert "2 of 2 rollouts succeeded in 5 attempts" in text[0]
    assert "controller: reference motions" in text[1]
    assert "failed: 2 body_contact, 1 no_goal" in text
    failed = next(line for line in text if line.split()[:1] == ["1"])
    assert failed.split(None, 5) == ["1", "walk_to", "body_contact", "12", "2.4", "left_hand touched table"]
    succeeded = next(line for line in text if line.split()[:1] == ["4"])
    assert succeeded.split()[2] == "succeeded"


def test_a_round_that_was_not_run_is_told(scene):
    with pytest.raises(RobotError, match=r"rounds.1.rollouts"):
        describe_rollouts(scene, 1)
