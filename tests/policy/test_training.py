"""A training goes on with its own task alone: what decides its episodes is told by content, wherever it lies."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from bundles import new_bundle
from expected_errors import refused

pytest.importorskip("gymnasium", reason="the extra `policy` is not installed")
pytest.importorskip("torch", reason="the extra `policy` is not installed")

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.policy.dagger import bundle_episodes, loop
from r2sego_blender.policy.dagger.settings import DaggerSettings
from r2sego_blender.policy.environment.reference_room import COLLISION, LIGHT
from r2sego_blender.policy.training import TRAINED_IN, Task, train_policy
from r2sego_blender.robot.model.humanoid import humanoid_mjcf

SCOPE = "[behaviours]\nsit_on = 1.0\n[sit_on]\nhold_s = {}\n"


class TrainingBegins(Exception):  # noqa: N818  (it is none)
    """The training of ``train_policy`` begins."""


@pytest.fixture(autouse=True)
def no_training(monkeypatch):
    def begins(*_):
        raise TrainingBegins

    monkeypatch.setattr(Task, "environment", lambda task: SimpleNamespace(limits=None))
    monkeypatch.setattr(bundle_episodes, "BundleEpisodes", lambda env: None)
    monkeypatch.setattr(loop, "train_student", begins)


@pytest.fixture
def task(tmp_path: Path) -> Task:
    (tmp_path / "scope.toml").write_text(SCOPE.format(2.0))
    (tmp_path / "robot.xml").write_text(humanoid_mjcf())
    (tmp_path / "tracker.onnx").write_bytes(b"weights")
    room = new_bundle(
        tmp_path / "here" / "room.r2s", scope=str(tmp_path / "scope.toml"), robot=str(tmp_path / "robot.xml")
    )
    room.asset_file.write_bytes(b"splats")
    room.collision_folder.mkdir()
    (room.collision_folder / "scene.xml").write_text("<mujoco/>")
    (room.captures_folder / "cameras.json").write_text("{}")
    (tmp_path / "reference" / COLLISION).mkdir(parents=True)
    for file in (LIGHT, f"{COLLISION}/scene.xml"):
        (tmp_path / "reference" / file).write_text("true")
    return Task(room.path, tracker=str(tmp_path / "tracker.onnx"))


def train(task: Task, folder: Path) -> None:
    with pytest.raises(TrainingBegins):
        train_policy(task, folder, DaggerSettings())


def rewritten(*names: str):
    def change(task: Task) -> None:
        file = task.scene.joinpath(*names)
        file.write_text(file.read_text() + " ")

    return change


CHANGES = {
    "scope": lambda task: (task.scene / "../../scope.toml").resolve().write_text(SCOPE.format(1.0)),
    "another scope": lambda task: Scene.open(task.scene).declare(scope="sit_down"),
    "robot": lambda task: (task.scene / "../../robot.xml").resolve().write_text(humanoid_mjcf().replace("0.2", "0.21")),
    "rollouts": lambda task: Scene.open(task.scene).declare(overrides={"rollouts.max_force_n": 60.0}),
    "tracker": rewritten("..", "..", "tracker.onnx"),
    "region": rewritten("captures", "cameras.json"),
    "light": rewritten("..", "..", "reference", LIGHT),
    "reference": rewritten("..", "..", "reference", COLLISION, "scene.xml"),
}


@pytest.mark.parametrize("changed", CHANGES)
def test_a_training_of_a_task_that_has_changed_does_not_go_on(task, tmp_path, changed):
    task = dataclasses.replace(task, reference=str(tmp_path / "reference"))
    train(task, tmp_path / "student")
    train(task, tmp_path / "student")
    CHANGES[changed](task)
    with refused(SettingsError, tmp_path / "student" / TRAINED_IN, changed.split()[-1].replace("light", "reference")):
        train_policy(task, tmp_path / "student", DaggerSettings())


def test_in_a_reference_room_another_training_takes_place(task, tmp_path):
    train(task, tmp_path / "student")
    with refused(SettingsError, TRAINED_IN, "reference"):
        train_policy(
            dataclasses.replace(task, reference=str(tmp_path / "reference")), tmp_path / "student", DaggerSettings()
        )


def test_a_training_goes_on_where_all_lies_elsewhere_and_what_changes_nothing_has_changed(task, tmp_path):
    train(task, tmp_path / "student")
    moved = shutil.copytree(task.scene, tmp_path / "there" / "room.r2s")
    (tmp_path / "my scope.toml").write_text("# mine\n" + SCOPE.format("2.000"))
    shutil.move(tmp_path / "tracker.onnx", tmp_path / "there" / "tracker.onnx")
    Scene.open(moved).declare(scope=str(tmp_path / "my scope.toml"), overrides={"rollouts.processes": 3})
    train(Task(moved, tracker=str(tmp_path / "there" / "tracker.onnx")), tmp_path / "student")
    (tmp_path / "my scope.toml").write_text(SCOPE.format(2.5))
    with refused(SettingsError, TRAINED_IN, "scope"):
        train_policy(
            Task(moved, tracker=str(tmp_path / "there" / "tracker.onnx")), tmp_path / "student", DaggerSettings()
        )


def test_a_training_that_did_not_write_its_task_down_whole_may_be_another(task, tmp_path):
    file = tmp_path / "student" / TRAINED_IN
    train(task, file.parent)
    said = json.loads(file.read_text())
    file.write_text(json.dumps({name: value for name, value in said.items() if name != "scope_sha256"}))
    with refused(SettingsError, file, "scope"):
        train_policy(task, file.parent, DaggerSettings())
    assert "scope_sha256" not in json.loads(file.read_text())
