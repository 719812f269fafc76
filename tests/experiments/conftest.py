"""A plan of small pictures, and what its stand-in for the program obeys."""

from __future__ import annotations

import pytest
from fake_experiment import PLAN, pictures

from r2sego_blender.experiments.cells import cells_of
from r2sego_blender.experiments.inputs import fixed_inputs
from r2sego_blender.experiments.plan import Plan


@pytest.fixture
def plan_file(tmp_path):
    pictures(tmp_path / "room", 6, 0)
    pictures(tmp_path / "held_out", 2, 20)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


@pytest.fixture
def plan(plan_file):
    return Plan.load(plan_file)


@pytest.fixture
def two_cells(plan_file):
    """The plan with one seed, as its file has it then."""
    plan_file.write_text(PLAN.replace("[0, 1]", "[0]"))
    return Plan.load(plan_file)


@pytest.fixture
def cells(plan, tmp_path):
    """The cells of the plan, whose imports are there."""
    found = cells_of(plan, fixed_inputs(plan, tmp_path / "out", write=False), tmp_path / "out")
    for cell in found:
        cell.imported.mkdir(parents=True, exist_ok=True)
    return found


@pytest.fixture
def control(tmp_path, monkeypatch):
    """What the stand-in obeys, and where it notes the commands that it finished."""
    folder = tmp_path / "control"
    folder.mkdir()
    monkeypatch.setenv("FAKE_CONTROL", str(folder))
    return folder
