"""Prepared plans: the paper's tables on a folder's scenes, with budgets that match, and data sets by their names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from dataset_folders import semantic_nerf
from fake_experiment import PROGRAM, finished, pictures

from r2sego_blender.commands.cli import main
from r2sego_blender.commands.reproduce import PREPARED, reproduce
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.evaluation.arms import REFINED, VANILLA
from r2sego_blender.experiments import prepared
from r2sego_blender.experiments.experiment import Experiment, run_experiment
from r2sego_blender.experiments.gathering import MARKDOWN
from r2sego_blender.experiments.prepared import DatasetChoice, dataset_plan, prepared_plan, scenes_in


@pytest.fixture
def data(tmp_path):
    for name in ("office_2", "room_0", "notes"):
        (tmp_path / "data" / name).mkdir(parents=True)
    for name in ("office_2", "room_0"):
        (tmp_path / "data" / name / "cameras.json").write_text("{}")
    return tmp_path / "data"


@pytest.mark.parametrize("name", PREPARED)
def test_every_prepared_plan_can_be_run_on_scenes_and_compares_with_others(data, name):
    plan = prepared_plan(name, data)
    assert [scene.name for scene in plan.scenes] == ["office_2", "room_0"]
    assert plan.scenes[0].captures == data / "office_2" and plan.scenes[0].frozen == data / "office_2/cameras.json"
    assert {VANILLA, REFINED} <= set(plan.arms) and plan.counts[0] == 6


def test_variants_of_table_2_have_as_many_views_and_steps(data):
    settings = [one.settings(0) for one in prepared_plan("table2", data).presets]
    assert len({one.rounds * one.selection.target_views for one in settings}) == 1
    assert len({one.rounds * one.training.steps_per_round for one in settings}) == 1
    assert len(set(map(str, settings))) == len(settings)


def test_scenes_are_chosen_by_name(data):
    assert [one.captures.name for one in scenes_in(data, ["room_0"])] == ["room_0"]
    assert [one.captures for one in scenes_in(data / "room_0")] == [data / "room_0"]
    with pytest.raises(ExperimentError, match="Did you mean office_2"):
        scenes_in(data, ["office2"])
    for empty in (data / "notes", data / "nothing"):
        with pytest.raises(ExperimentError, match="no scene"):
            scenes_in(empty)


def test_every_plan_that_comes_along_has_a_command():
    plans = {file.stem for file in Path(prepared.__file__).with_name("plans").iterdir()}
    assert plans == set(PREPARED) and set(reproduce.commands) == {*plans, "table3"}  # the last is of policies


def test_a_prepared_plan_is_run_as_any(tmp_path):
    room = tmp_path / "data" / "office_2"
    cameras = {"width": 8, "height": 6, "fx": 6.0, "captures": [], "frozen": []}
    for key, numbers in (("captures", range(6)), ("frozen", (20, 21))):
        (room / key).mkdir(parents=True)
        pictures(room / key, len(numbers), numbers[0])
        for index in numbers:
            pose = [[1, 0, 0, index], [0, 0, 1, 0], [0, -1, 0, 1], [0, 0, 0, 1]]
            cameras[key].append({"file": f"{key}/{index:02d}.png", "world_from_camera": pose})
    (room / "cameras.json").write_text(json.dumps(cameras))
    asked = ["--data", str(tmp_path / "data"), "--out", str(tmp_path / "out"), "--dry-run", "--json"]
    told = CliRunner().invoke(main, ["reproduce", "table2", *asked])
    assert told.exit_code == 0, told.output
    assert len(json.loads(told.stdout)["cells"]) == 15 and not (tmp_path / "out").exists()
    told = CliRunner().invoke(main, ["reproduce", "fig-captures", *asked])
    assert told.exit_code == 1 and "office_2 has 6 captures, and 45 are asked for" in told.stderr


def test_a_data_set_is_run_by_its_name(tmp_path, control):
    semantic_nerf(tmp_path / "data/office_3", 90)
    semantic_nerf(tmp_path / "data/room_0/Sequence_1", 60)
    asked = ["--data", str(tmp_path / "data"), "--out", str(tmp_path / "out"), "--dry-run", "--json"]
    told = CliRunner().invoke(main, ["experiment", "replica", *asked])
    assert told.exit_code == 0, told.output
    assert len(json.loads(told.stdout)["cells"]) == 2 * 5 and not (tmp_path / "out").exists()
    told = CliRunner().invoke(main, ["experiment", "replica", *asked, "--scenes", "room_0", "--seeds", "1"])
    assert [one["name"] for one in json.loads(told.stdout)["cells"]] == ["room_0, 6 captures, paper, seed 0"]

    choice = DatasetChoice(captures=5, preset="preview", seeds=1)
    plan = dataset_plan("replica", tmp_path / "data", tmp_path / "out/scenes", choice)
    found, failures = run_experiment(plan, tmp_path / "out", 1, program=PROGRAM)
    assert not failures and [cell.captures for cell in found.cells] == [5, 5]
    assert all(cell.inputs.frozen for cell in found.cells)
    table = (tmp_path / "out" / MARKDOWN).read_text()
    assert table.index("| office_3 | 5 |") < table.index("| room_0 | 5 |") < table.index("not the same set")

    plan = dataset_plan("replica", tmp_path / "data", tmp_path / "out/scenes", choice)
    assert not Experiment.of(plan, tmp_path / "out").left and len(finished(control, "refine")) == 2


def test_what_a_data_set_has_not_is_told(tmp_path):
    semantic_nerf(tmp_path / "office_3", 90)
    for name, data, choice, what in (
        ("replicas", tmp_path, DatasetChoice(), "Did you mean replica"),
        ("replica", tmp_path / "office_3/rgb", DatasetChoice(), "traj_w_c.txt"),
        ("7scenes", tmp_path, DatasetChoice(), "seq-01"),
        ("replica", tmp_path, DatasetChoice(("office_2",)), "Did you mean office_3"),
        ("replica", tmp_path, DatasetChoice(sensor_depth=True), "no sensor's depth"),
    ):
        with pytest.raises(ExperimentError, match=what):
            dataset_plan(name, data, tmp_path / "scenes", choice)
    for asked in (["replica"], ["plan.toml", "--captures", "6"], ["plan.toml", "--sensor-depth"]):
        assert CliRunner().invoke(main, ["experiment", *asked, "--out", str(tmp_path / "out")]).exit_code == 2
