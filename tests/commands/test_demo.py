"""The demo room becomes a scene in one command, and goes on when it is started again."""

import shutil

import numpy as np
import pytest

from r2sego_blender import pipeline
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.demo import ROOM, make_demo_scene
from r2sego_blender.core.errors import MachineError, SceneError
from r2sego_blender.core.images import save_image
from r2sego_blender.core.progress import SILENT
from r2sego_blender.evaluation import scene_report

QUICK = {"captures.refine_poses": "never"}


@pytest.fixture
def refined(monkeypatch):
    """Scenes that the refinement, which is left out here, was asked for."""
    asked = []
    monkeypatch.setattr(pipeline, "refine", lambda scene, progress: asked.append(scene))
    monkeypatch.setattr(scene_report, "renew_scene_report", lambda scene, before: None)
    return asked


def test_it_is_made_refined_and_goes_on(tmp_path, refined):
    path = tmp_path / "new" / "demo.r2s"
    made = make_demo_scene(path, "preview", QUICK, SILENT)
    assert made.path == path
    assert Scene.open(path).declaration.preset == "preview"
    assert Scene.open(path).declaration.overrides == QUICK
    assert len(list((path / "captures" / "images").iterdir())) == 6
    before = (path / "captures" / "cameras.json").stat().st_mtime_ns
    make_demo_scene(path, "paper", {}, SILENT)
    assert (path / "captures" / "cameras.json").stat().st_mtime_ns == before
    assert [scene.declaration.preset for scene in refined] == ["preview", "paper"]


def test_what_a_person_has_declared_stays_when_it_goes_on(tmp_path, refined):
    path = tmp_path / "demo.r2s"
    make_demo_scene(path, None, QUICK, SILENT).declare(preset="paper", overrides={"rounds": 2})
    make_demo_scene(path, None, {"seed": 7}, SILENT)
    assert [scene.declaration.preset for scene in refined] == ["preview", "paper"]
    assert refined[-1].declaration.overrides == {"rounds": 2, "seed": 7}


def test_a_bundle_of_something_else_is_left_alone(tmp_path, refined):
    path = tmp_path / "mine.r2s"
    room = tmp_path / "room"
    shutil.copytree(ROOM / "captures", room / "captures")
    shutil.copy(ROOM / "cameras.json", room)
    make_demo_scene(path, "preview", QUICK, SILENT, room)
    save_image(room / "captures" / "another.png", np.zeros((8, 8, 3), np.uint8))
    before = (path / "scene.toml").read_text()
    with pytest.raises(SceneError, match="other photographs"):
        make_demo_scene(path, "paper", {}, SILENT, room)
    assert (path / "scene.toml").read_text() == before


def test_where_the_room_is_missing_it_says_so(tmp_path, refined):
    with pytest.raises(MachineError, match="demo room is not here"):
        make_demo_scene(tmp_path / "demo.r2s", "preview", {}, SILENT, tmp_path)
    assert not list(tmp_path.iterdir())
