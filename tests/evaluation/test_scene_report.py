"""The report of a scene says what is so of it."""

import json

import numpy as np
import pytest
from bundles import new_bundle
from small_bundle import bundle, camera

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.captures.store import load_captures
from r2sego_blender.config.settings import SelectionSettings
from r2sego_blender.evaluation.scene_report import renew_scene_report, write_scene_report
from r2sego_blender.generation.conditions.condition_files import save_conditions
from r2sego_blender.generation.conditions.conditions import Condition
from r2sego_blender.robot.rollouts.rollout import save_rollouts
from r2sego_blender.robot.rollouts.rollouts import Rollout
from r2sego_blender.views.references import with_references
from r2sego_blender.views.selection import save_candidates, select_targets


@pytest.fixture
def scene(tmp_path):
    """A bundle without rounds, whose behaviour scope brings its own robot."""
    scope = tmp_path / "scope.toml"
    scope.write_text('[robot]\nmodel = "embedded:wheeled"\n')

    def fill(folder):
        (folder / "captures" / "images").mkdir(parents=True)
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": []}))

    return new_bundle(tmp_path / "room.r2s", fill, scope=str(scope))


def test_the_robot_is_the_one_in_use(scene):
    assert scene.declaration.robot == "embedded:humanoid"
    page = write_scene_report(scene).read_text(encoding="utf-8")
    assert "embedded:wheeled" in page and "embedded:humanoid" not in page


def test_whom_a_page_is_handed_on_to_learns_no_folders(scene, tmp_path):
    page = write_scene_report(scene).read_text(encoding="utf-8")
    assert "scope.toml" in page and str(tmp_path) not in page


def _made(scene, text):
    Runner(scene).step("asset.ply", lambda file: file.write_text(text), parameters=text)


def test_photographs_are_counted_and_no_other_files(tmp_path):
    scene = bundle(tmp_path, [None], None)
    (scene.captures_folder / "images/.DS_Store").write_bytes(b"a Mac's")
    assert "2 photographs, 0" in write_scene_report(scene).read_text(encoding="utf-8")


def test_scores_stay_on_the_page_where_a_refinement_made_nothing(scene):
    _made(scene, "an asset")
    page = write_scene_report(scene)
    page.write_text("the scores")
    before = scene.journal()
    scored = {"arms": {}, "assets": {"asset.ply": scene.outputs()["asset.ply"]}}
    scene.metrics_file.write_text(json.dumps(scored))
    _made(scene, "an asset")
    assert renew_scene_report(scene, before) == page
    assert page.read_text() == "the scores"
    _made(scene, "another")
    assert renew_scene_report(scene, before) == page
    assert "embedded:wheeled" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("metrics", [{"arms": {}, "assets": {"asset.ply": "another's"}}, [], None])
def test_a_page_of_scores_that_do_not_hold_is_written_anew(scene, metrics):
    _made(scene, "an asset")
    page = write_scene_report(scene)
    page.write_text("the scores")
    if metrics is not None:
        scene.metrics_file.write_text(json.dumps(metrics))
    renew_scene_report(scene, scene.journal())
    assert "embedded:wheeled" in page.read_text(encoding="utf-8")


def test_the_page_shows_a_view_whose_reference_is_no_capture_any_more(tmp_path):
    scene, cameras, settings = bundle(tmp_path, [None], None), [camera(), camera(0.1)], SelectionSettings()
    folder = scene.round_folder(0)
    (folder / "asset.ply").write_bytes(b"")  # the round has ended
    rollout = Rollout(True, "", 2, np.eye(1, 7, 3).repeat(3, 0), np.arange(3.0), np.tile(np.eye(4), (3, 1, 1)), (0, 0))
    (folder / "rollouts").mkdir()
    save_rollouts(folder / "rollouts", [rollout])
    seen = [capture.camera for capture in load_captures(scene.captures_folder)]
    chosen = select_targets(np.full(2, 0.9), np.full(2, 0.5), np.zeros(2, int), np.arange(2), settings)
    wall = lambda one: np.full(one.shape, 2.0, np.float32)  # noqa: E731
    with_references(chosen, cameras, seen, wall, settings, 2).save(folder / "selection")
    save_candidates(folder / "selection", cameras)
    record = {
        "accepted": True,
        "reason": "registered",
        "rank": 0,
        "generator": "blending",
        "candidate": 0,
        "rollout": 0,
        "frame": 0,
        "reference": 0,
        "reference_name": "removed.png",
        "overlap": 0.5,
        "estimate": None,
    }
    views, shape = folder / "views/000", cameras[0].shape
    empty = Condition(
        cameras[0],
        np.zeros(shape, np.float32),
        np.zeros((*shape, 3), np.float32),
        np.zeros(shape, np.uint8),
        np.zeros(shape, np.float32),
        np.zeros(shape, np.int32),
    )
    save_conditions(views / "conditions", [empty])
    (views / "pose.json").write_text(json.dumps(record))
    assert "removed.png" in write_scene_report(scene).read_text(encoding="utf-8")
