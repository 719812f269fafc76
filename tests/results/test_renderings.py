"""``render``: a scene's asset at each stage, or splats of a file, from given cameras."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from refined_asset import BACKDROP, CAMERA, ROOM, refined_scene
from refined_asset import r2sego as run

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.images import load_image_uint8, to_uint8
from r2sego_blender.splats.rendering.rasterizer import render


@pytest.fixture
def r2sego(monkeypatch):
    return partial(run, monkeypatch)


@pytest.fixture
def scene(tmp_path) -> Scene:
    return refined_scene(tmp_path)


@pytest.mark.parametrize("what", ["a folder", "gone"])
def test_a_round_is_not_rendered_without_its_backdrop(r2sego, scene, tmp_path, what):
    with (scene.path / "journal.jsonl").open("a") as journal:  # as the step that makes it notes it
        journal.write(json.dumps({"step": "geometry/backdrop.ply", "inputs": "", "output": "0"}) + "\n")
    (scene.path / "geometry/backdrop.ply").unlink()
    if what == "a folder":
        (scene.path / "geometry/backdrop.ply").mkdir()
    options = ["--cameras", cameras_file(tmp_path), "--to", tmp_path / "out", "--round", 0]
    done = r2sego("render", scene.path, *options)
    assert done.exit_code == 1, done.output
    assert "backdrop.ply: the splat file cannot be read. Run `r2sego refine` again." in done.stderr


def cameras_file(folder: Path) -> Path:
    file = folder / "cameras.json"
    file.write_text(json.dumps({"cameras": [{"name": "here", **CAMERA.to_json()}]}))
    return file


@pytest.mark.parametrize("stage", ["initial", "0", "final"])
def test_a_scene_is_rendered_at_every_stage_with_its_backdrop(r2sego, scene, tmp_path, stage):
    done = r2sego("render", scene.path, "--cameras", cameras_file(tmp_path), "--to", tmp_path / "out", "--round", stage)
    assert done.exit_code == 0, done.output
    whole = ROOM.asset.concatenated(BACKDROP.with_degree(ROOM.asset.degree))
    asset = ROOM.asset.subset(np.arange(100)) if stage == "initial" else whole
    picture = load_image_uint8(tmp_path / "out" / "here.png")
    np.testing.assert_array_equal(picture, to_uint8(render(asset, CAMERA).colour))


def test_a_file_is_rendered_and_the_result_told(scene, tmp_path):
    file = scene.path / "rounds/0/asset.ply"
    command = ["render", file, "--cameras", cameras_file(tmp_path), "--to", tmp_path / "out"]
    done = subprocess.run(
        [sys.executable, "-m", "r2sego_blender", *command, "--pass", "depth", "--json-progress"],
        capture_output=True,
        text=True,
        check=True,
    )
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["event"] == "result" and told["gaussians"] == 900
    assert [Path(f).name for f in told["files"]] == ["here_depth.png", "here.npz"]


def test_rendering_names_what_is_missing(r2sego, scene, tmp_path):
    options = ["--cameras", cameras_file(tmp_path), "--to", tmp_path / "out"]
    assert "0, final" in r2sego("render", scene.path, *options, "--round", 7).stderr
    assert "none.ply" in r2sego("render", tmp_path / "none.ply", *options).stderr
    assert not (tmp_path / "out").exists()


def test_photographs_are_not_replaced_by_pictures_of_their_cameras(r2sego, scene, tmp_path):
    file, photograph = cameras_file(tmp_path), tmp_path / "here.png"
    photograph.write_bytes(b"a photograph")
    done = r2sego("render", scene.path, "--cameras", file, "--to", tmp_path, "--pass", "depth", "--pass", "colour")
    assert done.exit_code == 1 and str(photograph) in done.stderr
    assert photograph.read_bytes() == b"a photograph" and not (tmp_path / "here_depth.png").exists()
    assert r2sego("render", scene.path, "--cameras", file, "--to", tmp_path, "--pass", "depth").exit_code == 0


def test_photographs_that_the_cameras_name_are_not_replaced(r2sego, scene, tmp_path):
    """As a cameras.json has them, in a folder of their own."""
    photograph, entry = tmp_path / "photos/here.png", {"name": "here", "file": "photos/here.png", **CAMERA.to_json()}
    photograph.parent.mkdir()
    photograph.write_bytes(b"a photograph")
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"captures": [entry, {**entry, "name": "no", "file": "no\0name"}]}))
    done = r2sego("render", scene.asset_file, "--cameras", file, "--to", tmp_path / "photos")
    assert done.exit_code == 1 and str(photograph) in done.stderr
    assert photograph.read_bytes() == b"a photograph"


@pytest.mark.parametrize(
    ("lens", "warns"),
    [({"distortion": [0.1, 0.0]}, True), ({"k1": -0.2}, True), ({"distortion": [0.0, 0.0], "k1": 0.0}, False)],
)
def test_distortion_that_is_not_rendered_is_told(r2sego, scene, tmp_path, lens, warns):
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"cameras": [{"name": "here", **CAMERA.to_json()}], **lens}))
    done = r2sego("render", scene.path, "--cameras", file, "--to", tmp_path / "out")
    assert done.exit_code == 0 and ("distortion" in done.stderr) == warns


@pytest.mark.parametrize("place", ["captures/images", "rounds/0", ""])
def test_pictures_are_not_written_into_a_scene(r2sego, scene, tmp_path, place):
    before = content_digest(scene.path)
    done = r2sego("render", scene.path, "--cameras", cameras_file(tmp_path), "--to", scene.path / place)
    assert done.exit_code == 1 and content_digest(scene.path) == before
