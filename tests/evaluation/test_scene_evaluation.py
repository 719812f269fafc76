"""Evaluating a bundle: rounds and causes stand in metrics.json, in the report and on the terminal."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cameras_file import save_cameras_json
from progress_recorder import ProgressRecorder
from small_bundle import bundle, camera, photographs, splats

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.captures.store import load_captures
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import SceneError
from r2sego_blender.evaluation import arm_scores, frozen_views, scene_evaluation, scene_report
from r2sego_blender.evaluation.arms import ARMS, GAUSSGYM, INITIAL, REFINED, SAME_POINTS, VANILLA, WITHOUT_GENERATED
from r2sego_blender.evaluation.frozen_pictures import FROZEN_PICTURES
from r2sego_blender.evaluation.frozen_views import seen_in_training
from r2sego_blender.evaluation.report_data import Round
from r2sego_blender.evaluation.scene_causes import CAUSES
from r2sego_blender.geometry.proxy.proxy import PROXY
from r2sego_blender.results.status import lines
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import save_ply

TRAINED = (VANILLA, GAUSSGYM, SAME_POINTS, WITHOUT_GENERATED)


@pytest.fixture
def evaluated(tmp_path, monkeypatch):
    """A bundle of two rounds, of which the second is the worse, and where its frozen views are."""
    scene = bundle(tmp_path, [splats(0.55), splats(0.62)], SplatAsset.empty())
    for name, asset in (("asset.ply", splats(0.62)), ("geometry/initial_asset.ply", splats(0.8))):
        save_ply(scene.path / name, asset)
    views = photographs(tmp_path, (-0.1, 0.0, 0.1), "frozen")
    save_cameras_json(tmp_path / "cameras.json", views)
    cameras = json.loads((tmp_path / "cameras.json").read_text(encoding="utf-8"))
    (tmp_path / "cameras.json").write_text(json.dumps(cameras | {"frozen": cameras["captures"]}))
    # What is compared with is trained, and rollouts are described, elsewhere; neither is read here.
    (scene.path / ARMS[WITHOUT_GENERATED].asset).parent.mkdir(parents=True)
    monkeypatch.setattr(
        arm_scores,
        "train_arms",
        lambda scene, progress, arms: [
            save_ply(scene.path / ARMS[arm].asset, splats(0.9)) for arm in TRAINED if arm in arms
        ],
    )
    monkeypatch.setattr(scene_report, "_round", lambda scene, index, influence: Round(index))
    return scene, tmp_path / "cameras.json"


def test_rounds_and_causes_are_in_the_file_the_page_and_the_table(evaluated):
    scene, frozen = evaluated
    metrics = scene_evaluation.evaluate_scene(scene, frozen)
    assert metrics == json.loads((scene.report_folder / "metrics.json").read_text(encoding="utf-8"))
    first, second = metrics["rounds"]
    assert (first["round"], second["round"]) == (0, 1) and first["psnr"] > second["psnr"]
    assert second["psnr"] == metrics["arms"]["refined"]["psnr"]  # the last round is the refined asset
    mark = f"{first['psnr'] - second['psnr']:.2f} dB below round 0"
    assert second["mark"] == mark and "mark" not in first
    told = [one for one in metrics["causes"]["shares"] if one["error"] is not None]
    assert [one["cause"] for one in told] == list(CAUSES)[1:]
    np.testing.assert_allclose(sum(one["error"] for one in told), 1.0, atol=1e-3)

    page = (scene.report_folder / "index.html").read_text(encoding="utf-8")
    assert mark in page and "Told by the proxy alone" in page
    for cause in CAUSES.values():
        assert cause.label in page
    assert len(list((scene.report_folder / "figures").glob("causes-*.jpg"))) == 3

    for one in (metrics["arms"]["refined"], *metrics["arms"]["refined"]["views"]):
        assert one["psnr_seen"] == pytest.approx(one["psnr"], abs=0.1) and 0.0 <= one["unseen"] < 0.1
    assert metrics["arms"]["refined"]["seen_by"] == "the proxy alone"
    pictures = scene.read(FROZEN_PICTURES)
    assert list(pictures) == [view["name"] for view in metrics["arms"]["refined"]["views"]]
    for view in pictures.values():
        assert set(view.arms) == set(metrics["arms"])
        for file in (view.truth, *view.arms.values(), view.unseen):
            assert file.stat().st_size > 0

    table = scene_evaluation.table(metrics)
    assert mark in table and "told by the proxy alone" in table
    assert table.index("round 0") < table.index("round 1") < table.index("mean over 3 frozen views")


def test_poses_that_were_refined_are_told_in_the_file_the_page_and_the_table_and_scored_there(evaluated, monkeypatch):
    scene, frozen = evaluated
    as_given = scene_evaluation.evaluate_scene(scene, frozen)
    assert as_given["frozen_poses"] == "" and "their poses" not in scene_evaluation.table(as_given)
    told = "poses refined from 1234 tracks"

    def aside(views, captures, settings, progress):
        return tuple(replace(view, camera=camera(3.0)) for view in views), told

    monkeypatch.setattr(frozen_views, "adjusted_views", aside)
    metrics = scene_evaluation.evaluate_scene(scene, frozen)
    assert metrics["frozen_poses"] == told and told in scene_evaluation.table(metrics)
    assert told in (scene.report_folder / "index.html").read_text(encoding="utf-8")
    assert metrics["arms"]["refined"]["psnr"] < as_given["arms"]["refined"]["psnr"] - 1.0  # the splats end before it


def test_the_scores_say_of_which_assets_they_are(evaluated):
    scene, frozen = evaluated
    Runner(scene).step("asset.ply", lambda file: save_ply(file, splats(0.62)), inputs=[])
    assets = scene_evaluation.evaluate_scene(scene, frozen)["assets"]
    assert assets == {"asset.ply": content_digest(scene.asset_file)}
    Runner(scene).step("asset.ply", lambda file: save_ply(file, splats(0.7)), inputs=[], parameters=["anew"])
    assert scene.outputs()["asset.ply"] != assets["asset.ply"]


def test_a_frozen_view_that_was_trained_on_is_told(evaluated):
    scene, frozen = evaluated
    recorder, captures = ProgressRecorder(), load_captures(scene.captures_folder)
    listed = json.loads(frozen.read_text(encoding="utf-8"))
    apart = [view for view in listed["frozen"] if view["world_from_camera"][0][3] != 0.0]
    assert not seen_in_training(scene, captures[:0])
    apart[0]["world_from_camera"] = captures[1].camera.world_from_camera.tolist()
    frozen.write_text(json.dumps(listed | {"frozen": apart}), encoding="utf-8")
    scene_evaluation.evaluate_scene(scene, frozen, recorder)
    (warning,) = [text for level, text in recorder.messages if level == "warning"]
    assert warning.startswith(f"{apart[0].get('name', Path(apart[0]['file']).name)}: taken from where a capture")


def test_arms_that_are_not_asked_for_are_neither_trained_nor_scored(evaluated):
    scene, frozen = evaluated
    whole = scene_evaluation.evaluate_scene(scene, frozen)["arms"]
    for arm in TRAINED:
        (scene.path / ARMS[arm].asset).unlink()
    metrics = scene_evaluation.evaluate_scene(scene, frozen, arms=(VANILLA,))
    assert set(metrics["arms"]) == {VANILLA, REFINED}
    assert metrics["arms"] == {arm: whole[arm] for arm in (VANILLA, REFINED)}
    assert ARMS[INITIAL].label not in scene_evaluation.table(metrics)
    assert [(scene.path / ARMS[arm].asset).is_file() for arm in TRAINED] == [arm == VANILLA for arm in TRAINED]


def test_an_asset_that_was_changed_since_is_not_scored(evaluated):
    scene, frozen = evaluated
    Runner(scene).step("asset.ply", lambda file: save_ply(file, splats(0.62)), inputs=[])
    save_ply(scene.asset_file, splats(0.7))
    with pytest.raises(SceneError, match=r"asset\.ply: it is not as it was made.*refine"):
        scene_evaluation.evaluate_scene(scene, frozen)
    assert not scene.metrics_file.exists()


def test_where_an_earlier_round_lost_its_asset_all_is_told_by_the_last_rounds_proxy(evaluated):
    scene, frozen = evaluated
    whole = scene_evaluation.evaluate_scene(scene, frozen)
    first = scene.read(PROXY.of_round(0))
    replace(first, vertices=first.vertices + np.array([1.5, 0.4, 0.0])).save(scene.path / "rounds/0/proxy/proxy.npz")
    (scene.path / "rounds/0/asset.ply").unlink()
    metrics = scene_evaluation.evaluate_scene(scene, frozen)
    assert "missing" in metrics["rounds"][0] and metrics["rounds"][1]["psnr"] == whole["rounds"][1]["psnr"]
    for part in ("arms", "causes", "generator"):
        assert metrics[part] == whole[part]
    assert "2 refinement rounds" in (scene.report_folder / "index.html").read_text(encoding="utf-8")


def test_an_asset_of_what_was_declared_before_is_told(evaluated):
    scene, frozen = evaluated
    recorder = ProgressRecorder()
    Runner(scene).step("asset.ply", lambda file: save_ply(file, splats(0.62)), inputs=[])  # of nothing that is declared
    scene_evaluation.evaluate_scene(scene, frozen, recorder)
    assert any("r2sego refine" in text for level, text in recorder.messages if level == "warning")
    assert "Not up to date" in (scene.report_folder / "index.html").read_text(encoding="utf-8")


def test_a_bundle_that_lost_its_proxy_is_scored_and_says_so(evaluated):
    scene, frozen = evaluated
    shutil.rmtree(scene.path / "rounds/1/proxy")
    shutil.rmtree(scene.path / "rounds/0/proxy")
    (scene.path / "rounds/1/asset.ply").unlink()
    (scene.path / "rounds/0/asset.ply").unlink()
    metrics = scene_evaluation.evaluate_scene(scene, frozen)
    assert "proxy" in metrics["causes"]["unavailable"]
    assert all(one["psnr"] is None and "missing" in one for one in metrics["rounds"])
    page = (scene.report_folder / "index.html").read_text(encoding="utf-8")
    assert "Not available: " in page and "not scored: rounds/0/asset.ply" in page
    assert "not scored" in scene_evaluation.table(metrics)


def test_the_status_tells_rounds_and_the_largest_cause():
    entry = {"label": "edges", "error": 0.7, "mended_by": "finer splats"}
    other = {"label": "wrong depth", "error": None, "mended_by": "priors"}
    rounds = [
        {"round": 0, "psnr": 25.5, "ssim": 0.8},
        {"round": 1, "psnr": 25.0, "ssim": 0.79, "mark": "0.50 dB below round 0"},
        {"round": 2, "psnr": None, "ssim": None, "missing": "it is not there"},
    ]
    arms = {"refined": {"psnr": 25.0, "ssim": 0.79}}
    state = {
        "scene": "room.r2s",
        "captures": 6,
        "captures_source": "cameras.json",
        "ground": "floor",
        "scale_source": "metric",
        "robot": "humanoid",
        "scope": "walk",
        "preset": "paper",
        "overrides": {},
        "rounds": [],
        "rounds_declared": 3,
        "outdated": [],
        "obstacle": "",
        "refined": True,
        "of_old_frame": [],
        "damaged": [],
        "half_corrected": False,
        "metrics": {"arms": arms, "rounds": rounds, "causes": {"shares": [other, entry]}},
        "metrics_outdated": False,
    }
    text = "\n".join(lines(state))
    assert "PSNR 25.00 dB, SSIM 0.790, 0.50 dB below round 0" in text
    assert "not scored: it is not there" in text
    assert "largest cause of error: edges, 70% of it; finer splats" in text
    state["metrics"] = {"arms": arms}  # as older versions wrote it
    assert "largest cause" not in "\n".join(lines(state))
