"""The paired experiment: pairs differ in what they see alone, what is there is kept, and the table is the paper's."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from bundles import new_bundle
from expected_errors import refused

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import NativeError, SettingsError
from r2sego_blender.policy.dagger.settings import DaggerSettings
from r2sego_blender.policy.paired.experiment import DECLARED, PairedExperiment, run_experiment
from r2sego_blender.policy.paired.policies import OUTCOMES
from r2sego_blender.policy.paired.table import markdown
from r2sego_blender.policy.training import Task

BASELINE, REFINED = (0, 0, 1, 2, 1), (7, 7, 7, 6, 6)  # the paper's, of 8


@pytest.fixture
def experiment(tmp_path: Path) -> PairedExperiment:
    arms, room = {}, new_bundle(tmp_path / "room.r2s")
    (tmp_path / "tracker.onnx").write_text("weights")
    for folder in (room.collision_folder, tmp_path / "reference" / "collision"):
        folder.mkdir(parents=True)
        (folder / "scene.xml").write_text("<mujoco/>")
    for name in ("vanilla", "refined"):
        (tmp_path / f"{name}.ply").write_text(name)
        arms[name] = Task(room.path, str(tmp_path / f"{name}.ply"), tracker=str(tmp_path / "tracker.onnx"))
    return PairedExperiment(arms, {"separate chairs": {"chairs": ["stool"]}}, 5, 8, DaggerSettings(seed=3))


class Training:
    """Succeeds as often as the paper's policies, and dies at the ``dies``-th."""

    def __init__(self, dies: int = 0) -> None:
        self.requests: list[dict] = []
        self._dies = dies

    def __call__(self, request: dict) -> None:
        self.requests.append(request)
        if len(self.requests) == self._dies:
            raise NativeError("it died")
        place = Path(request["place"])
        seed = request["settings"]["seed"] - 3
        successes = (BASELINE if place.name == "vanilla" else REFINED)[seed]
        outcomes = [[number, "" if number < successes else "fall", 10, 2.0] for number in range(request["episodes"])]
        place.mkdir(parents=True)
        (place / OUTCOMES).write_text(json.dumps(dict.fromkeys(request["tests"], outcomes)))


def test_the_policies_of_a_pair_differ_in_their_asset_alone(experiment, tmp_path):
    training = Training()
    run_experiment(experiment, tmp_path / "out", processes=1, train=training)
    assert len(training.requests) == 10
    for first, second in zip(training.requests[::2], training.requests[1::2], strict=True):
        assert first["task"].pop("asset") != second["task"].pop("asset")
        assert first.pop("place") != second.pop("place")
        for tests in (first["tests"], second["tests"]):
            assert tests["separate chairs"]["chairs"] == ["stool"]
            assert {Path(task.pop("asset")).name for task in tests.values()} <= {"vanilla.ply", "refined.ply"}
        assert first == second
    assert [request["settings"]["seed"] for request in training.requests[::2]] == [3, 4, 5, 6, 7]


def test_what_is_there_is_not_made_again(experiment, tmp_path):
    first, rest = Training(dies=4), Training()
    with pytest.raises(NativeError):
        run_experiment(experiment, tmp_path / "out", processes=1, train=first)
    found = run_experiment(experiment, tmp_path / "out", processes=2, train=rest)
    assert len(first.requests) - 1 + len(rest.requests) == 10  # none but the one that died is made twice
    again = Training()
    assert run_experiment(experiment, tmp_path / "out", train=again) == found
    assert again.requests == []


def test_another_experiment_is_not_mixed_in(experiment, tmp_path):
    run_experiment(experiment, tmp_path / "out", train=Training())
    Path(experiment.arms["refined"].asset).write_text("refined again")
    with pytest.raises(SettingsError) as refused:
        run_experiment(experiment, tmp_path / "out", train=Training())
    assert refused.value.cure


@pytest.mark.parametrize("file", ["tracker.onnx", "room.r2s/collision/scene.xml", "reference/collision/scene.xml"])
def test_no_file_that_decides_the_outcomes_may_change(experiment, tmp_path, file):
    tests = {"reference room": {"reference": str(tmp_path / "reference")}}
    experiment, training = dataclasses.replace(experiment, tests=tests), Training()
    run_experiment(experiment, tmp_path / "out", processes=1, train=training)
    (tmp_path / file).write_text("another")
    with refused(SettingsError, tmp_path / "out" / DECLARED):
        run_experiment(experiment, tmp_path / "out", processes=1, train=training)
    assert len(training.requests) == 10


def test_no_other_scope_may_be_declared(experiment, tmp_path):
    run_experiment(experiment, tmp_path / "out", train=Training())
    (tmp_path / "scope.toml").write_text("[behaviours]\nsit_on = 1.0\n[sit_on]\nhold_s = 1.0\n")
    Scene.open(tmp_path / "room.r2s").declare(scope=str(tmp_path / "scope.toml"))
    with refused(SettingsError, tmp_path / "out" / DECLARED):
        run_experiment(experiment, tmp_path / "out", train=Training())


def test_an_experiment_that_does_not_say_its_tasks_may_be_another(experiment, tmp_path):
    run_experiment(experiment, tmp_path / "out", train=Training())
    file = tmp_path / "out" / DECLARED
    file.write_text(
        json.dumps(
            {"arms": {}, **{name: json.loads(file.read_text())[name] for name in ("seeds", "episodes", "settings")}}
        )
    )
    with refused(SettingsError, file, "tasks"):
        run_experiment(experiment, tmp_path / "out", train=Training())


def test_the_table_has_the_paper_s_numbers(experiment, tmp_path):
    found = run_experiment(experiment, tmp_path / "out", train=Training())
    table = "\n".join(markdown(found, {"vanilla": 19.16, "refined": 21.48}))
    for cell in ("| 3 | 2 | 6 |", "10.0 ± 10.5 %", "82.5 ± 6.8 %", "72.5 points", "[52.3, 92.7]", "0.0625", "19.16 dB"):
        assert cell in table
    assert table.count("### Test") == 2
    assert "fall 36" in table
    assert "fall 7" in table
