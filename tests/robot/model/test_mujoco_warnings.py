"""MuJoCo's warnings come with the rollouts, and leave no file where the process runs."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from progress_recorder import ProgressRecorder

from r2sego_blender.config.settings import RolloutSettings
from r2sego_blender.core.errors import RobotError
from r2sego_blender.robot.behaviours.walk_to import WalkTo
from r2sego_blender.robot.model.mujoco_warnings import described, mujoco_warnings
from r2sego_blender.robot.rollouts.rollout import load_rollouts, save_rollouts
from r2sego_blender.robot.rollouts.rollouts import successful_rollouts
from r2sego_blender.robot.scope.scope import BehaviourScope, Episode

SCOPE = replace(
    BehaviourScope.load("walk_and_look"), episode=Episode(duration_s=2.0), walk_to=WalkTo(distance_m=(0.1, 1.0))
)
BALL = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A working folder of the test's own."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def step_from_nowhere(steps: int = 1) -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    for _ in range(steps):
        data.qpos[0] = np.nan
        mujoco.mj_step(model, data)


def test_warnings_are_heard_by_the_inner_block_and_written_nowhere(elsewhere):
    with mujoco_warnings() as outer:
        with mujoco_warnings() as inner:
            step_from_nowhere()
        assert len(inner) == 1 and inner[0].startswith("Nan, Inf or huge value in QPOS")
        assert "Time" not in inner[0]
        assert not outer
        step_from_nowhere()
        assert outer == inner
    assert not list(elsewhere.iterdir())


def test_an_error_inside_gives_the_handler_back(elsewhere):
    before = mujoco.get_mju_user_warning()
    with pytest.raises(ZeroDivisionError), mujoco_warnings():
        raise ZeroDivisionError
    assert mujoco.get_mju_user_warning() is before


def test_the_most_frequent_are_told_first():
    assert described([]) == ""
    assert described(["a", "b", "b"]) == "b (2 times); a"
    assert described("abcde") == "a; b; c; and 2 others"


@pytest.mark.parametrize("processes", [1, 2])
def test_a_simulation_that_diverges_fails_by_it(humanoid, box_room, elsewhere, processes):
    """MuJoCo starts anew from the origin after it; the frames after that are no rollout's."""
    room = box_room()
    heavy = '<mujoco><option gravity="0 0 -1e13"/>'
    room.write_text(room.read_text().replace("<mujoco>", heavy))
    told, settings = ProgressRecorder(), RolloutSettings(successes=1, max_attempts=2, processes=processes)
    with pytest.raises(RobotError, match=r"2 failed by non_finite \(the simulation diverged\)"):
        successful_rollouts(humanoid, SCOPE, room, settings, 0, told)
    ((level, text),) = told.messages
    assert level == "warning" and text.startswith("MuJoCo warned in 2 of 2 attempts: Nan, Inf or huge value")
    assert not list(elsewhere.iterdir())


def test_a_rollout_keeps_its_warnings(humanoid, box_room, tmp_path):
    told = ProgressRecorder()
    (rollout,) = successful_rollouts(humanoid, SCOPE, box_room(), RolloutSettings(successes=1), 1, told)
    assert rollout.warnings == () and not told.messages
    save_rollouts(tmp_path, [replace(rollout, warnings=("it gave up",))])
    (loaded,) = load_rollouts(tmp_path)
    assert loaded.warnings == ("it gave up",)
