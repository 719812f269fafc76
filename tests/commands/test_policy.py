"""The commands on policies: trained, gone on with, evaluated, exported."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("gymnasium", reason="the extra `policy` is not installed")

import onnxruntime
from training_room import training_room

from r2sego_blender.commands.cli import main
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.policy.dagger.evaluation import Evaluation
from r2sego_blender.policy.dagger.loop import episode_seed
from r2sego_blender.policy.training import Task, evaluation_seeds, lines, settings_of
from r2sego_blender.results.policy_evaluation import EMBEDDED_DRIVE

SHORT = {"teacher_episodes": 1, "views": 4, "eye_epochs": 1, "iterations": 1, "episodes": 1, "epochs": 1}


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return training_room(tmp_path_factory.mktemp("policy") / "room.r2s")


def run(*words):
    done = CliRunner().invoke(main, ["policy", *map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_policy_is_trained_once_and_evaluated(room, tmp_path):
    folder = tmp_path / "trained"
    given = [word for key, value in SHORT.items() for word in ("--set", f"{key}={value}")]
    assert run("train", room, "--to", folder, *given).split() == [str(folder / "student.onnx")]
    session = onnxruntime.InferenceSession(folder / "student.onnx")
    assert [one.name for one in session.get_inputs()] == ["rgb", "proprio", "state"]
    checkpoint = (folder / "checkpoint.npz").read_bytes()
    run("train", room, "--to", folder, *given)
    assert (folder / "checkpoint.npz").read_bytes() == checkpoint
    other = CliRunner().invoke(
        main, ["policy", "train", *map(str, (room, "--to", folder, *given, "--chairs", "stool"))]
    )
    assert other.exit_code == 1 and "trained_in.json" in other.output
    assert (folder / "checkpoint.npz").read_bytes() == checkpoint
    told = json.loads(run("evaluate", room, "--policy", folder, "--episodes", 1, "--json"))
    assert told["episodes"] == 1 and told["successes"] + sum(told["failures"].values()) == 1


def test_the_teacher_is_evaluated_and_what_helps_it_is_said_and_kept(room, tmp_path):
    kept = tmp_path / "kept"
    told = json.loads(run("evaluate", room, "--policy", "teacher", "--episodes", 2, "--json", "--record", kept))
    assert json.loads((kept / "evaluation.json").read_text()).items() >= told.items()
    assert told["successes"] == 2 and told["mean_assist_n"] > 0.0


def test_what_cannot_be_is_a_sentence(room, tmp_path):
    for words in (
        ["evaluate", room, "--policy", tmp_path / "nothing"],
        ["train", room, "--to", tmp_path / "t", "--set", "epoch=3"],
        ["train", room, "--to", tmp_path / "t", "--set", "epochs=many"],
        ["train", room, "--to", tmp_path / "t", "--chairs", "throne"],
        ["train", room, "--to", tmp_path / "t", "--tracker", tmp_path / "nothing.onnx"],
    ):
        done = CliRunner().invoke(main, ["policy", *map(str, words)])
        assert done.exit_code == 1 and "Traceback" not in done.output, done.output
    assert not (tmp_path / "t").exists()


@pytest.mark.parametrize(("tracker", "driver"), [("", EMBEDDED_DRIVE), ("a/twist.onnx", "twist.onnx")])
def test_what_drove_the_robot_is_said(tracker, driver):
    task = Task(Path("room.r2s"), tracker=tracker)
    told = [*lines(task, "teacher", Evaluation(3, 4, 0.19, 0.99, {"fall": 1}, 0.0))]
    assert driver in task.driver and task.driver in told[-1]


def test_settings_are_checked_as_others_are():
    found = settings_of({"epochs": "5", "learning_rate": "0.01"})
    assert (found.epochs, found.learning_rate) == (5, 0.01)
    for key, text in (("epochs", "0"), ("epochs", "2.5"), ("learning_rate", "nan"), ("nothing", "1")):
        with pytest.raises(SettingsError):
            settings_of({key: text})


def test_a_policy_is_not_judged_by_what_it_learnt_from():
    settings = settings_of({})
    trained = {episode_seed(settings, number) for number in range(1000)}
    judged = evaluation_seeds(0, 1000)
    assert len(set(judged)) == 1000 and not trained & set(judged)
    assert np.all(np.array(judged) >= 0)
