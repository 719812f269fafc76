"""The report's figures, as the engine writes them."""

import json
import shutil

import fake_captures
import pytest
from expected_errors import refused

from r2sego_blender.core.errors import SceneError
from r2sego_blender.results.panels.bundle import Bundle
from r2sego_blender.results.panels.report_scores import report_scores


@pytest.fixture
def evaluated(bundle_path, tmp_path):
    """A bundle with these figures."""
    shutil.copytree(bundle_path, tmp_path / "copy.r2s")

    def evaluated(metrics):
        file = tmp_path / "copy.r2s" / "report" / "metrics.json"
        file.write_text(json.dumps(metrics))
        return Bundle.open(tmp_path / "copy.r2s")

    return evaluated


def _arm(psnr, lpips=None):
    return {"psnr": psnr, "ssim": 0.8, "lpips_alex": lpips, "views": [{"name": "a"}, {"name": "b"}]}


def test_arms_rounds_and_causes(evaluated):
    trained = {"vanilla_3dgs": _arm(21.5), "same_points": _arm(21.75), "without_generated_views": _arm(24.5)}
    arms = {"initial": _arm(19.5), "refined": _arm(25.0, 0.2), **trained}
    scores = report_scores(evaluated({"arms": arms, "rounds": fake_captures.ROUNDS, "causes": fake_captures.CAUSES}))
    assert [(arm.label, arm.psnr, arm.lpips) for arm in scores.arms] == [
        ("Refined", 25.0, 0.2),
        ("No generated views", 24.5, None),
        ("Same points", 21.75, None),
        ("Vanilla 3DGS", 21.5, None),
        ("Initial", 19.5, None),
    ]
    assert scores.summary == "25.00 dB (+3.25), SSIM 0.800"
    assert [(one.label, one.psnr) for one in scores.rounds] == [("Round 0", 24.2), ("Round 1", 23.9), ("Round 2", None)]
    assert [(one.label, one.error) for one in scores.causes] == [
        ("Wrong depth", 0.41),
        ("Splats off the surface", 0.16),
        ("Edges", None),
    ]
    assert scores.mending == "Wrong depth: more photographs"


def test_what_is_not_known_is_left_out(evaluated):
    assert report_scores(evaluated({"arms": {"refined": _arm(None)}})).summary == ""
    assert report_scores(evaluated({"arms": {"refined": _arm(25.0)}})).summary == "25.00 dB, SSIM 0.800"
    told = report_scores(evaluated({"arms": {}, "causes": {"unavailable": "no depth"}}))
    assert told.causes == () and told.causes_note == "no depth" and told.summary == ""
    assert told.mending == ""


def test_of_an_asset_that_changed_since_there_is_no_summary(evaluated):
    bundle = evaluated({"arms": {"refined": _arm(25.0)}, "assets": {"asset.ply": "as it was"}})
    journal = bundle.scene.path / "journal.jsonl"
    for digest, outdated in (("as it was", False), ("as it is", True)):
        journal.write_text(json.dumps({"step": "asset.ply", "output": digest}) + "\n")
        told = report_scores(bundle)
        assert (told.outdated, told.summary == "") == (outdated, outdated)
        assert told.arms[0].psnr == 25.0


@pytest.mark.parametrize(
    "damage",
    [
        {"arms": {"refined": {"psnr": 1}}},
        {"arms": {"refined": {"psnr": "nan", "ssim": 0.8}}},
        {"arms": []},
        {"rounds": [{}]},
        {"causes": {"shares": [3]}},
    ],
)
def test_damaged_figures_are_named(evaluated, damage):
    with refused(SceneError, "report/metrics.json", cure="Evaluate"):
        report_scores(evaluated(damage))
