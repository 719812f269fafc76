"""``r2sego texture``: a scene's proxy becomes a GLB, in the bundle or beside it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bundles import new_bundle
from click.testing import CliRunner, Result
from room_meshes import closed_room, observed_proxy

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.commands import cli
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.digests import content_digest
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.results.texture import FILE

ROOM = Path(__file__).parents[2] / "demo" / "room"
SIZE_M = (5.0, 4.4, 2.6)
SMALL = ["--size", 256, "--faces", 300]


@pytest.fixture(autouse=True)
def signals_stay_the_tests_own(monkeypatch):
    monkeypatch.setattr(cli, "cancel_at_once", lambda _: None)


def r2sego(*arguments: object) -> Result:
    return CliRunner().invoke(cli.main, list(map(str, arguments)))


def shell(size: float) -> GeometryProxy:
    """The demo room's walls, floor and ceiling, without its furniture."""
    mesh = closed_room(SIZE_M).subdivide_to_size(0.5)
    return observed_proxy(mesh.vertices * size, mesh.faces)


@pytest.fixture
def scene(tmp_path) -> Scene:
    """The demo room's photographs, small, with two rounds' proxies."""
    about = json.loads((ROOM / "cameras.json").read_text())
    lens = {key: about[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}
    captures = [
        Capture(
            Path(entry["file"]).stem,
            ROOM / entry["file"],
            Camera(**lens, world_from_camera=np.array(entry["world_from_camera"])).scaled(0.25),
        )
        for entry in about["captures"]
    ]

    def fill(folder: Path) -> None:
        save_captures(folder / "captures", captures)
        for index, size in enumerate((2.0, 1.0)):
            (folder / f"rounds/{index}/proxy").mkdir(parents=True)
            shell(size).save(folder / f"rounds/{index}/proxy/proxy.npz")

    return new_bundle(tmp_path / "room.r2s", fill)


def test_the_newest_proxy_is_baked_into_the_bundle(scene):
    done = r2sego("texture", scene.path, *SMALL)
    assert done.exit_code == 0, done.output
    assert "unwrapped by xatlas" in done.stdout
    assert [p.name for p in scene.path.iterdir() if p.suffix == ".glb"] == [FILE]
    mesh = trimesh.load(scene.path / FILE, force="mesh", process=False)
    x, y, z = SIZE_M
    np.testing.assert_allclose(mesh.bounds, [[-x / 2, 0, -y / 2], [x / 2, z, y / 2]], atol=1e-3)
    assert mesh.visual.material.baseColorTexture.size == (256, 256)


def test_a_proxy_of_more_rounds_than_are_declared_is_not_baked(scene):
    """The second round is what an earlier refinement left."""
    scene.declare(overrides={"rounds": 1})
    assert r2sego("texture", scene.path, *SMALL).exit_code == 0
    mesh = trimesh.load(scene.path / FILE, force="mesh", process=False)
    assert mesh.bounds[1, 0] == pytest.approx(SIZE_M[0], abs=1e-3)


def test_the_figures_are_those_of_what_was_written(scene, tmp_path):
    """The shell alone shows the captures again, but for the furniture's far sides."""
    file = tmp_path / "out.glb"
    command = [sys.executable, "-m", "r2sego_blender", "texture", scene.path, "--to", file, "--json-progress"]
    done = subprocess.run([*map(str, [*command, *SMALL])], capture_output=True, text=True, cwd=ROOM.parents[1])
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.strip().splitlines()[-1])
    assert told["event"] == "result" and told["file"] == str(file)
    assert told["megabytes"] == pytest.approx(file.stat().st_size / 1e6)
    assert told["faces"] <= 300 and told["size_px"] == 256
    assert told["covered"] == 1.0 and 0.5 < told["seen"] <= 1.0
    assert told["psnr_db"] > 18
    assert not (scene.path / FILE).exists()


def test_the_same_scene_gives_the_same_bytes(scene, tmp_path):
    for name in ("a.glb", "b.glb"):
        assert r2sego("texture", scene.path, "--to", tmp_path / name, *SMALL).exit_code == 0
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--to", "out.stl"], "ends neither in .glb nor in .obj"),
        (["--size", 1], "texture.size_px is 1"),
        (["--size", 64, "--set", "texture.unwrap_seconds=0", "--set", "texture.padding_px=32"], "do not fit"),
    ],
)
def test_what_cannot_be_is_one_line_and_leaves_nothing(scene, options, words):
    before = sorted(p.name for p in scene.path.iterdir())
    done = r2sego("texture", scene.path, *options)
    assert done.exit_code == 1 and isinstance(done.exception, SystemExit), done.output
    assert words in done.stderr.strip().splitlines()[-1]
    assert sorted({*before, ".lock"}) == sorted({*(p.name for p in scene.path.iterdir()), ".lock"})


def test_a_folder_that_is_not_there_is_told_before_anything_is_baked(scene):
    done = r2sego("texture", scene.path, "--to", "/no/such/folder/out.glb", *SMALL)
    assert done.exit_code == 1
    assert done.stderr == f"r2sego: {Path('/no/such/folder')}: there is no such folder. Make it first.\n"


def test_a_scene_without_a_proxy_says_what_to_run(scene):
    for index in range(2):
        (scene.round_folder(index) / "proxy" / "proxy.npz").unlink()
    done = r2sego("texture", scene.path)
    assert done.exit_code == 1 and "r2sego refine" in done.stderr


def test_the_obj_that_is_told_is_there(scene, tmp_path):
    done = r2sego("texture", scene.path, "--to", tmp_path / "room.OBJ", *SMALL)
    file = Path(done.stdout.split(": ")[0])
    assert file.parent == tmp_path and file.is_file() and file.name in (tmp_path / "room.xml").read_text()


@pytest.mark.parametrize("suffix", [".mtl", ".png", ".xml"])
def test_what_lies_beside_a_new_obj_is_not_written_over(scene, tmp_path, suffix):
    own = tmp_path / f"IMG_1{suffix}"
    own.write_bytes(b"a person's own")
    options = ["--to", tmp_path / "IMG_1.obj", *SMALL]
    done = r2sego("texture", scene.path, *options)
    assert done.exit_code == 1 and str(own) in done.stderr
    assert own.read_bytes() == b"a person's own" and not (tmp_path / "IMG_1.obj").exists()
    own.unlink()
    assert [r2sego("texture", scene.path, *options).exit_code for _ in range(2)] == [0, 0]  # its own are replaced


@pytest.mark.parametrize("name", ["collision/mesh.obj", "room.obj", "captures/room.glb"])
def test_nothing_else_in_the_scene_is_written_over(scene, name):
    before = content_digest(scene.path)
    assert r2sego("texture", scene.path, "--to", scene.path / name, *SMALL).exit_code == 1
    assert content_digest(scene.path) == before
