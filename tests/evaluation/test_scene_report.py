"""The report of a scene says what is so of it."""

import json

import numpy as np
import pytest

from r2sego_blender.evaluation.scene_report import renew_scene_report, write_scene_report
from r2sego_blender.scene import Scene
from r2sego_blender.scene_declaration import Declaration


@pytest.fixture
def scene(tmp_path):
    """A bundle without rounds, whose behaviour scope brings its own robot."""
    scope = tmp_path / "scope.toml"
    scope.write_text('[robot]\nmodel = "embedded:wheeled"\n')
    declaration = Declaration(
        captures_source="cameras.json", world_from_capture=tuple(map(tuple, np.eye(4).tolist())),
        ground="floor plane", scale_source="metric poses", scope=str(scope),
    )  # fmt: skip

    def fill(folder):
        (folder / "captures" / "images").mkdir(parents=True)
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": []}))

    return Scene.create(tmp_path / "room.r2s", declaration, fill)


def test_the_robot_is_the_one_in_use(scene):
    assert scene.declaration.robot == "embedded:humanoid"
    page = write_scene_report(scene).read_text(encoding="utf-8")
    assert "embedded:wheeled" in page and "embedded:humanoid" not in page


def _made(scene, text):
    scene.step("asset.ply", lambda file: file.write_text(text), parameters=text)


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
