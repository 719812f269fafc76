"""Data sets are found by name, and a new one is one file."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2sego_blender.commands.experiments import experiment
from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.experiments.datasets import registry, sets
from r2sego_blender.experiments.datasets.registry import DATASETS, dataset
from r2sego_blender.experiments.prepared import dataset_plan

NEW_SET = """
from pathlib import Path
from ..dataset import Dataset, Split

def scenes(data):
    return {"attic": data}

def split(place, name, count, progress):
    from ....captures.poses.cameras_json import read_cameras_json
    return Split(*[read_cameras_json(place / file, place)[0] for file in ("a.json", "b.json")], "as listed")

DATASET = Dataset("attics", "a.json and b.json", 3, scenes, split)
"""


def test_every_set_is_named_in_the_commands_help_and_on_its_page():
    page = (Path(__file__).parents[3] / "docs/experiments.md").read_text()
    assert set(DATASETS) == {"replica", "7scenes", "scannetpp"}
    for name, one in DATASETS.items():
        assert name in (experiment.help or "") and f"| `{name}` |" in page and one.captures >= 6


def test_a_name_that_is_none_is_told_the_one_it_resembles():
    with pytest.raises(ExperimentError, match="Did you mean scannetpp"):
        dataset("scannet++")


def test_a_new_set_is_one_file(tmp_path, monkeypatch):
    (tmp_path / "attics.py").write_text(NEW_SET)
    monkeypatch.setattr(sets, "__path__", [*sets.__path__, str(tmp_path)])
    monkeypatch.setattr(registry, "DATASETS", registry._records())
    (tmp_path / "a.json").write_text('{"captures": []}')
    (tmp_path / "b.json").write_text('{"captures": []}')
    plan = dataset_plan("attics", tmp_path, tmp_path / "scenes")
    assert [one.name for one in plan.scenes] == ["attic"] and plan.published == "attics"
