"""Every round is scored, in order, over the backdrop; a step back and a lost round are said."""

from __future__ import annotations

import json

import numpy as np
import pytest
from small_bundle import WIDTH, bundle, photographs, splats

from r2sego_blender.core.images import to_uint8
from r2sego_blender.evaluation.exposure.exposures import exposures_of
from r2sego_blender.evaluation.lpips.weights import WEIGHTS_VARIABLE
from r2sego_blender.evaluation.round_scores import RoundScore, as_entries, below, lines, score_rounds
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.metrics import psnr, ssim
from r2sego_blender.splats.rendering.rasterizer import render


@pytest.fixture(autouse=True)
def _no_lpips_weights(monkeypatch):
    monkeypatch.delenv(WEIGHTS_VARIABLE, raising=False)


def _scored(scene, views):
    return score_rounds(scene, views, exposures_of(scene))


def test_rounds_are_scored_in_order_over_the_backdrop(tmp_path):
    """Assets cover the left half alone; the right is the backdrop's in every round."""
    left = slice(None, WIDTH // 2)
    assets = [splats(grey, columns=left) for grey in (0.7, 0.55, 0.8)]
    backdrop = splats(0.6, columns=slice(WIDTH // 2, None))
    scene = bundle(tmp_path, assets, backdrop)
    views = photographs(tmp_path, (0.0, 0.05), "frozen")
    rounds = _scored(scene, views)
    assert [one.round for one in rounds] == [0, 1, 2]
    for one, asset in zip(rounds, assets, strict=True):
        whole = asset.concatenated(backdrop)
        pictures = [to_uint8(render(whole, view.camera).colour) / np.float32(255) for view in views]
        truths = [view.image() for view in views]
        scores = [(psnr(p, t), ssim(p, t)) for p, t in zip(pictures, truths, strict=True)]
        np.testing.assert_allclose((one.psnr, one.ssim), np.mean(scores, axis=0), rtol=1e-6)
        alone = render(asset, views[0].camera).colour
        assert psnr(alone, truths[0]) < one.psnr - 3.0  # its right half is black
    assert rounds[1].psnr > rounds[0].psnr > rounds[2].psnr
    marks = below(rounds)
    assert marks[:2] == ("", "")
    assert marks[2] == f"{rounds[1].psnr - rounds[2].psnr:.2f} dB below round 1"


def test_a_single_round_and_lost_ones_are_said(tmp_path):
    (tmp_path / "a").mkdir()
    views = photographs(tmp_path, (0.0,), "frozen")
    (one,) = _scored(bundle(tmp_path / "a", [splats(0.6)], SplatAsset.empty()), views)
    assert one.round == 0 and 15.0 < one.psnr < 30.0 and not one.missing
    assert below([one]) == ("",)

    (tmp_path / "b").mkdir()
    scene = bundle(tmp_path / "b", [splats(0.6), None, splats(0.7), splats(0.6)], SplatAsset.empty())
    (scene.path / "rounds/3/asset.ply").write_bytes(b"ply\nhalf")
    rounds = _scored(scene, views)
    assert [one.psnr is None for one in rounds] == [False, True, False, True]
    assert rounds[1].missing.startswith("rounds/1/asset.ply: ")
    assert rounds[3].missing.startswith("rounds/3/asset.ply: ")
    assert below(rounds)[2].endswith("dB below round 0")  # the last one that has a score
    assert rounds[0].psnr == pytest.approx(one.psnr)

    (scene.path / "geometry/backdrop.ply").unlink()
    assert all(one.missing.startswith("geometry/backdrop.ply: ") for one in _scored(scene, views))


def test_no_more_rounds_than_were_declared_are_scored(tmp_path):
    scene = bundle(tmp_path, [splats(0.6), splats(0.7)], SplatAsset.empty())
    again = scene.declare(overrides={"rounds": 1})
    views = photographs(tmp_path, (0.0,), "frozen")
    assert [one.round for one in _scored(again, views)] == [0]


def test_entries_are_json_and_lines_say_what_fell():
    rounds = [
        RoundScore(0, 25.12, 0.81),
        RoundScore(1, 24.907, 0.80),
        RoundScore(2, None, None, missing="rounds/2/asset.ply: the splat file cannot be read"),
        RoundScore(3, float("inf"), 1.0, 0.0),
        RoundScore(4, 24.0, 0.79),
    ]
    entries = json.loads(json.dumps(as_entries(rounds), allow_nan=False))
    assert entries[0] == {"round": 0, "psnr": 25.12, "ssim": 0.81}
    assert entries[1] == {"round": 1, "psnr": 24.907, "ssim": 0.8, "mark": "0.21 dB below round 0"}
    assert entries[2]["psnr"] is None and "cannot be read" in entries[2]["missing"]
    assert entries[3] == {"round": 3, "psnr": None, "ssim": 1.0, "lpips_alex": 0.0}
    assert entries[4]["mark"] == "inf dB below round 3"
    text = lines(entries)
    assert text[0].split() == ["round", "0", "25.12", "0.810"]
    assert text[1].split() == ["round", "1", "24.91", "0.800", "0.21", "dB", "below", "round", "0"]
    assert text[2].startswith("round 2") and "not scored: rounds/2/asset.ply" in text[2]
    assert text[3].split() == ["round", "3", "inf", "1.000"]
