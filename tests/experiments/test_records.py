"""A record says again what was written, and of what surfaces tell only what was measured."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from r2sego_blender.core.errors import ExperimentError
from r2sego_blender.experiments.records import MEASURED_KINDS, RECORD, Record, Stage, read_record, score_of

VIEW = {"name": "a.png", "psnr": 24.5, "ssim": 0.8, "lpips_alex": None, "psnr_seen": 26.0, "unseen": 0.25}
ARM = {"psnr": 24.0, "ssim": 0.8, "lpips_alex": None, "psnr_seen": None, "unseen": 0.25, "seen_by": "a mesh"}


def written(folder, **arm) -> Record:
    stages = (Stage("evaluate", 3.0, None, 800.0),)
    scored = {**ARM, "depth_error": 0.01, "views": [VIEW], **arm}
    record = Record("0" * 64, {"refined": scored}, {"asset.ply": "1" * 64}, stages, {"asset.ply": 2.5}, {}, 1.75e9)
    record.write(folder)
    return record


def test_what_was_measured_comes_back_and_nothing_else(tmp_path):
    assert read_record(tmp_path) is None
    record = written(tmp_path)
    assert read_record(tmp_path) == record
    arm = read_record(tmp_path).arms["refined"]
    assert set(MEASURED_KINDS) & set(arm) == {"psnr_seen", "unseen", "depth_error"}


def test_arms_that_could_not_be_run_and_backends_come_back(tmp_path):
    record = replace(written(tmp_path, backend="a model 1.0"), not_scored={"genfusion": "not set up"})
    record.write(tmp_path)
    assert read_record(tmp_path) == record and record.arms["refined"]["backend"] == "a model 1.0"
    data = json.loads((tmp_path / RECORD).read_text())
    del data["not_scored"]  # as records of earlier versions
    (tmp_path / RECORD).write_text(json.dumps(data))
    assert read_record(tmp_path) == replace(record, not_scored={})


def test_a_psnr_of_null_is_that_of_equal_images_and_other_figures_of_null_are_none():
    assert score_of(ARM, "psnr_seen") == math.inf and score_of(ARM, "lpips_alex") is None
    assert score_of(ARM, "psnr_unseen") is None and score_of(VIEW, "unseen") == 0.25


@pytest.mark.parametrize("damage", [{"psnr_unseen": "much"}, {"unseen": 1e30}, {"views": [{"psnr": 1.0}]}])
def test_a_damaged_figure_is_told(tmp_path, damage):
    written(tmp_path)
    data = json.loads((tmp_path / RECORD).read_text())
    data["arms"]["refined"] |= damage
    (tmp_path / RECORD).write_text(json.dumps(data))
    with pytest.raises(ExperimentError, match="damaged"):
        read_record(tmp_path)
