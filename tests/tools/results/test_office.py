"""The splits of the real office: what is held out is never an input, and what is compared is what was seen."""

import json
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.captures.frozen import load_frozen_views
from tools.results import office
from tools.results.office import SPLITS, prepare

DATA = Path(__file__).parents[4] / "shared"


@pytest.mark.parametrize("split", SPLITS)
def test_held_out_photographs_are_no_inputs(split, tmp_path):
    captures, held_out = SPLITS[split]
    assert len(captures) == len(set(captures)) == 12 and len(held_out) >= 9
    assert not set(captures) & set(held_out) and max(*captures, *held_out) < 63
    if split.startswith("away"):
        assert min(abs(a - b) for a in captures for b in held_out) >= 8
    if not (DATA / "captures/holo_office").is_dir():
        pytest.skip(f"{DATA / 'captures/holo_office'} is not here")
    folder = prepare(DATA, tmp_path / "office", split)
    cameras = folder / "photographs" / "cameras.json"
    assert [len(json.loads(cameras.read_text())[kind]) for kind in ("captures", "frozen")] == [12, len(held_out)]
    assert len(load_frozen_views(cameras)) == len(held_out)
    assert len(list((folder / "depth").iterdir())) == 12 + len(held_out)


def test_only_what_the_sensor_saw_is_compared():
    sensed = [np.array([[2.0, 0.0], [4.0, 1.0]])]
    found = [np.array([[2.04, 7.0], [4.2, 0.0]])]
    assert office._share(found, sensed, metres=0.05) == pytest.approx(1 / 3, abs=1e-4)
    assert office._share(found, sensed, relative=0.1) == pytest.approx(2 / 3, abs=1e-4)
