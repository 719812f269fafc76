"""The bench of scaling: what is reckoned by hand, and cells that sleep on the real scheduler."""

import json

import numpy as np
import pytest
from small_bundle import bundle, splats

from r2sego_blender.core.errors import SettingsError
from r2sego_blender.splats.asset import SplatAsset
from tools.benchmarks import scaling as bench


def test_cells_of_a_journal_sleep_and_all_come_to_their_end(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "_MANY", 50)
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    for step, seconds in (("geometry/depth", 30.0), ("rounds/0/asset.ply", 10.0), ("rounds/1/asset.ply", 10.0)):
        scene.note(step=step, inputs="0", output="1", seconds=seconds)
    figures = json.loads(json.dumps(bench.bench_scaling(scene.path, scenes=5, slots=2, faster=100)))
    assert figures["stages"] == {"geometry/depth": 30.0, "rounds, asset.ply": 20.0}
    assert figures["scene_s"] == 50.0 and figures["taken_s"] > 5 * 50.0 * (1 - bench.SPREAD) / 100 / 2
    assert any("50 scenes on 2" in line for line in bench.lines(figures))


def test_what_is_reckoned_lies_between_the_least_and_what_a_scheduler_may_take():
    rng = np.random.default_rng(0)
    for slots, count in ((1, 7), (4, 40), (8, 8), (16, 5)):
        cells_s = rng.uniform(1.0, 3.0, count).tolist()
        least_s, most_s = max(sum(cells_s) / slots, max(cells_s)), sum(cells_s) / slots + max(cells_s)
        assert least_s <= bench.reckoned_s(cells_s, slots) <= most_s
        ends = np.zeros(slots)
        for one in cells_s:  # as the scheduler does: the next to whichever is free first
            ends[ends.argmin()] += one
        assert bench.reckoned_s(cells_s, slots) == pytest.approx(ends.max(), rel=0.1)


def test_a_bundle_without_steps_and_numbers_below_one_are_told(tmp_path):
    scene = bundle(tmp_path, [splats(0.5)], SplatAsset.empty())
    with pytest.raises(SettingsError):
        bench.bench_scaling(scene.path, slots=0)
    (scene.path / "journal.jsonl").write_text("")
    with pytest.raises(SettingsError):
        bench.bench_scaling(scene.path)
