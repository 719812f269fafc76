"""The splits of the README's table: what is held out is never an input."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.images import image_files
from tools.results.measure import SCENES

ROOT = Path(__file__).parents[3]
DATA = ROOT.parent / "shared"


@pytest.fixture(params=list(SCENES))
def split(request, tmp_path):
    place = DATA / ("scenes" if request.param == "room_a" else "captures") / request.param
    if not place.is_dir():
        pytest.skip(f"{place} is not here")
    return SCENES[request.param](DATA, tmp_path)


def test_held_out_photographs_are_no_inputs(split):
    if split.poses is None:
        inputs = {file.read_bytes() for file in image_files(split.captures)}
        held_out = {file.read_bytes() for file in image_files(split.frozen)}
        assert (len(inputs), len(held_out)) == (13, 4)
    else:
        cameras = json.loads(split.poses.read_text())
        inputs = {entry["file"] for entry in cameras["captures"]}
        held_out = {entry["file"] for entry in cameras["frozen"]}
        imported = import_captures(split.captures, split.poses, CaptureSettings())
        assert len(imported.captures) == len(inputs)
        assert len(load_frozen_views(split.frozen)) == len(held_out)
    assert inputs and held_out and not inputs & held_out


def test_making_a_split_again_changes_nothing(split, tmp_path):
    """A measurement that was cut off goes on: the same photographs under the same names."""
    before = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*"))
    for name, make in SCENES.items():
        if any(name in str(path) for path in before):
            make(DATA, tmp_path)
    assert sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*")) == before


def test_a_command_that_fails_ends_it_with_its_status_and_words_alone(tmp_path):
    command = [sys.executable, "-m", "tools.results.measure", "--data", tmp_path, "--to", tmp_path / "out"]
    done = subprocess.run([*command, "--scene", "room_a"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr.startswith("r2sego: ") and len(done.stderr.splitlines()) == 1
