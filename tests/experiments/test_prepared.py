"""The paper's tables as prepared plans: on the scenes of a folder, with budgets that match."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from fake_experiment import pictures

from r2sego_blender.commands.cli import main
from r2sego_blender.commands.experiments import reproduce
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.evaluation.arms import REFINED, VANILLA
from r2sego_blender.experiments.prepared import PREPARED, prepared_plan, scenes_in


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
    (what,) = [one for one in reproduce.params if one.name == "what"]
    assert name in what.type.choices and len(what.type.choices) == len(PREPARED)


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
