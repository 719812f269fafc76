"""Exporting a finished scene: every file it names is there, in the formats that were asked for."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from bundles import new_bundle
from expected_errors import refused
from PIL import Image
from progress_recorder import ProgressRecorder
from pxr import Usd, UsdGeom, UsdPhysics, UsdVol
from room_meshes import observed_proxy

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.core import atomic_files as whole_files
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import AssetError, CaptureError, R2SEgoError, SceneError
from r2sego_blender.geometry.collision.collision import CollisionSurface
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.collision.convex import convex_hull
from r2sego_blender.results.export import export_scene
from r2sego_blender.results.status import describe, lines
from r2sego_blender.splats.formats.registry import load_asset, save_asset
from tools.benchmarks.workloads import made_up_room

PLAIN = ["asset.ply", "collision", "proxy.ply", "cameras.json"]
ABOUT = "about.txt"
ENTRY = {"file": "images/a.png", "name": "a.png", **Camera(64, 48, 50.0, 50.0, 32.0, 24.0, np.eye(4)).to_json()}


@pytest.fixture
def scene(tmp_path) -> Scene:
    """As much of a refined scene as exporting reads."""

    def fill(folder: Path) -> None:
        for name in ("captures", "collision", "rounds/0/proxy"):
            (folder / name).mkdir(parents=True)
        (folder / "captures" / "cameras.json").write_text(json.dumps({"captures": [ENTRY]}))
        (folder / "collision" / "mesh.obj").write_text("v 0 0 0\n")
        for name in ("asset.ply", "rounds/0/asset.ply"):
            save_asset(folder / name, made_up_room(200, (64, 48)).asset)
        observed_proxy(np.eye(3), [[0, 1, 2]]).save(folder / "rounds/0/proxy/proxy.npz")

    return new_bundle(tmp_path / "room.r2s", fill)


def test_a_scene_is_exported_as_before_when_no_format_is_named(scene, tmp_path):
    cameras = {"about": "In the world.", "captures": [ENTRY]}
    (scene.captures_folder / "cameras.json").write_text(json.dumps(cameras))
    written = export_scene(scene, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "cameras.json").read_text())
    assert told.pop("about") == (
        "In the world. world_from_camera is 4 x 4, of a camera with x right, y down and z forward. "
        "The photographs are in the scene's folder 'captures'."
    )
    assert told == {"captures": cameras["captures"]}
    assert [path.name for path in written] == [*PLAIN, ABOUT] and all(path.exists() for path in written)


def test_the_asset_is_written_in_every_format_asked_for_once(scene, tmp_path):
    written = export_scene(scene, tmp_path / "out", [".spz", ".glb", ".ply", ".spz"])
    assert [path.name for path in written] == [*PLAIN, "asset.spz", "asset.glb", ABOUT]
    assert all(len(load_asset(path)) == 200 for path in written if path.stem == "asset")


def test_it_says_what_each_file_is_in_which_frame_and_what_made_it(scene, tmp_path):
    (scene.path / "objects" / "chair").mkdir(parents=True)
    (scene.path / "objects" / "chair" / "backends.json").write_text('{"mesh": "SAM 3D 1.0"}')
    scene = scene.declare(overrides={"proxy.surface": "nksr"}, backends={"surface": "NKSR"})
    *written, about = export_scene(scene, tmp_path / "out", [".spz", ".usdc"])
    text = about.read_text(encoding="utf-8")
    told = {line.split()[0]: line for line in text.splitlines() if line}
    assert all(path.name in told for path in written)
    assert "Y up" in told["asset.spz"] and "Y up" not in told["asset.usdc"]
    assert "Metres" in text and "Z up" in text and "Ground: floor. Scale: metric." in text
    assert "surface: NKSR" in text and "object chair: mesh by SAM 3D 1.0" in text


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
def test_usd_splats_and_the_collision_surface_are_one_stage_too(scene, tmp_path, suffix):
    _add_collision_surface(scene)
    written = export_scene(scene, tmp_path / "out", [suffix])
    assert "room.usda" in [path.name for path in written]
    moved = (tmp_path / "out").rename(tmp_path / "elsewhere")
    stage = Usd.Stage.Open(str(moved / "room.usda"))
    assert not stage.GetCompositionErrors()
    assert stage.GetDefaultPrim().GetPath() == "/room" and UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    assert len([prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]) == 1
    colliders = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert {prim.GetName() for prim in colliders} == {"floor", "piece_0000"}
    splats = UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/room/splats"))
    assert np.array_equal(splats.GetPositionsAttr().Get(), load_asset(scene.asset_file).means)
    assert _seen(stage) == ["/room/splats"]


def test_a_textured_export_shows_the_room_to_mujoco_and_usd(scene, tmp_path):
    _add_collision_surface(scene)
    _add_captured_wall(scene)
    out = tmp_path / "out"
    export_scene(scene.declare(overrides={"texture.size_px": 64}), out, textured=True)
    stage = Usd.Stage.Open(str(out / "room.usda"))
    assert _seen(stage) == ["/room/textured"]
    image = stage.GetPrimAtPath("/room/textured/baked/texture").GetAttribute("inputs:file").Get()
    assert Path(image.resolvedPath) == out / "textured" / "room.png"
    model = mujoco.MjModel.from_xml_path(str(out / "textured" / "room.xml"))
    assert model.mesh_facenum.sum() == 2 and model.ntex == 1
    assert "textured" in (out / ABOUT).read_text()
    both = tmp_path / "both"
    export_scene(scene.declare(overrides={"texture.size_px": 64}), both, [".usda"], textured=True)
    assert _seen(Usd.Stage.Open(str(both / "room.usda"))) == ["/room/splats"]


def test_where_the_robot_may_begin_is_exported_too(scene, tmp_path):
    _add_collision_surface(scene)
    _add_captured_wall(scene)
    scope = tmp_path / "scope.toml"
    scope.write_text('name = "walk"\n[region]\nwithin = [[-1, -1], [1, -1], [1, 1], [-1, 1]]\n')
    written = export_scene(scene.declare(scope=str(scope)), tmp_path / "out")
    assert "spawn_poses.json" in [path.name for path in written]
    told = json.loads((tmp_path / "out" / "spawn_poses.json").read_text())
    places = np.array([pose["xy_m"] for pose in told["poses"]])
    assert len(places) > 4 and (np.abs(places) < 1.01).all() and np.linalg.norm(places, axis=1).min() > 0.3
    about = (tmp_path / "out" / ABOUT).read_text()
    assert "spawn_poses.json" in about
    assert "in the scope scope.toml" in about and str(tmp_path) not in about  # who it is handed on to


def test_where_it_may_not_begin_anywhere_is_a_word_and_the_export_stands(scene, tmp_path):
    _add_collision_surface(scene)
    _add_captured_wall(scene)
    heard = ProgressRecorder()
    written = export_scene(scene.declare(scope="sit_down"), tmp_path / "out", progress=heard)
    assert "spawn_poses.json" not in [path.name for path in written]
    assert [text for text in heard.warnings if "spawn_poses.json" in text]


def test_a_scene_that_one_stands_in_is_called_by_its_name(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(scene.path)
    *_, about = export_scene(Scene(Path(), scene.declaration), tmp_path / "out")
    assert about.read_text(encoding="utf-8").startswith(f"{scene.path.name}, exported by")


def test_a_folder_textured_that_no_export_made_is_left_alone(scene, tmp_path):
    kept = tmp_path / "out" / "textured" / "mine.png"
    kept.parent.mkdir(parents=True)
    kept.write_text("mine")
    with refused(SceneError, tmp_path / "out" / "textured", "no export made it"):
        export_scene(scene, tmp_path / "out", textured=True)
    export_scene(scene, tmp_path / "out")
    assert kept.read_text() == "mine"


def _add_collision_surface(scene: Scene) -> None:
    """A piece over a floor."""
    piece = convex_hull(np.random.default_rng(0).uniform(-0.3, 0.3, (12, 3)))
    floor = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    write_collision(CollisionSurface(*piece, (piece,), floor, 0.02), scene.collision_folder)


def _add_captured_wall(scene: Scene) -> None:
    """A wall as proxy, and a photograph of it."""
    picture = scene.captures_folder.parent / "wall.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)).save(picture)
    camera = Camera(64, 48, 60.0, 60.0, 32.0, 24.0, look_at((0.0, 0.0, 1.0), (0.0, 2.0, 1.0)))
    save_captures(scene.captures_folder, [Capture("wall", picture, camera)])
    corners = np.float32([(-1, 2, 0), (1, 2, 0), (1, 2, 2), (-1, 2, 2)])
    observed_proxy(corners, [[0, 1, 2], [0, 2, 3]]).save(scene.round_folder(0) / "proxy" / "proxy.npz")


def _seen(stage: Usd.Stage) -> list[str]:
    """The paths of what a camera sees."""
    shapes = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Boundable))
    return [str(prim.GetPath()) for prim in shapes if _is_seen(prim)]


def _is_seen(prim) -> bool:
    """Whether a camera sees a prim."""
    imageable = UsdGeom.Imageable(prim)
    return imageable.ComputeVisibility() != "invisible" and imageable.ComputePurpose() != "guide"


def test_an_unknown_format_is_refused_before_anything_is_written(scene, tmp_path):
    with pytest.raises(AssetError, match=r"\.obj.*\.spz"):
        export_scene(scene, tmp_path / "out", [".spz", ".obj"])
    assert not (tmp_path / "out").exists()


def test_what_is_exported_of_a_scene_that_may_only_be_read_can_be_written(scene, tmp_path):
    """Published scenes often are read-only; their export is moved, changed and replaced."""
    for path in (scene.path, *scene.path.rglob("*")):
        path.chmod(path.stat().st_mode & ~0o222)
    for _ in range(2):
        export_scene(scene, tmp_path / "out")
    for path in (tmp_path / "out").rglob("*"):
        assert path.stat().st_mode & 0o200, path


def test_a_second_export_replaces_what_is_no_more(scene, tmp_path):
    out = tmp_path / "out"
    export_scene(scene, out)
    piece = out / "collision" / "hulls" / "piece_9999.obj"
    piece.parent.mkdir(exist_ok=True)
    piece.write_text("v 0 0 0\n")
    (out / "mine.txt").write_text("kept")
    export_scene(scene, out)
    assert not piece.exists() and (out / "mine.txt").read_text() == "kept"
    assert {path.name for path in out.iterdir()} == {*PLAIN, ABOUT, "mine.txt"}


@pytest.mark.parametrize("renames", range(6))
def test_an_export_killed_as_it_took_its_place_can_be_made_again(scene, tmp_path, monkeypatch, renames):
    """The earlier one's folders are there whole or not at all, so that the next knows them."""
    out, left, rename = tmp_path / "out", [None] * renames, whole_files.rename
    export_scene(scene, out)
    made = content_digest(out)

    def killed(one, place):
        if not left:
            raise KeyboardInterrupt
        left.pop()
        rename(one, place)

    def cut_off(folder, **_):
        for file in (file for file in sorted(folder.rglob("*")) if file.is_file()):
            file.unlink()
            raise KeyboardInterrupt

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("r2sego_blender.results.export.rename", killed)
        patched.setattr(whole_files.shutil, "rmtree", cut_off)
        export_scene(scene, out)
    export_scene(scene, out)
    assert content_digest(out) == made
    assert {path.name for path in out.iterdir()} == {*PLAIN, ABOUT}


def test_what_only_an_earlier_export_wrote_is_told(scene, tmp_path):
    """A stage of the splats of before would stand beside the surface of now."""
    out, messages = tmp_path / "out", ProgressRecorder()
    *_, about = export_scene(scene, out, [".spz", ".usdc"], progress=messages)
    assert "not of this export" not in about.read_text(encoding="utf-8") and not messages.warnings
    export_scene(scene, out, [".spz"], progress=messages)
    text = about.read_text(encoding="utf-8")
    told = {line.split()[0] for line in text.splitlines() if "was there before" in line}
    assert told == {"room.usda", "asset.usdc"} and "room.usda, asset.usdc" in messages.warnings[0]


@pytest.mark.parametrize("name", ["asset.ply", "cameras.json", "about.txt", "asset.spz"])
def test_a_file_that_no_export_made_is_left_alone(scene, tmp_path, name):
    mine = tmp_path / "mine" / name
    mine.parent.mkdir()
    mine.write_text("mine")
    with refused(SceneError, mine, "no export made it"):
        export_scene(scene, mine.parent, [".spz"])
    assert list(mine.parent.iterdir()) == [mine] and mine.read_text() == "mine"


@pytest.mark.parametrize("name", ["my_scene.xml", "robots/arm.xml", "hulls/note.txt"])
def test_what_a_person_put_into_an_exported_folder_is_not_deleted(scene, tmp_path, name):
    out = tmp_path / "out"
    export_scene(scene, out)
    mine = out / "collision" / name
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("mine")
    with refused(SceneError, mine, "no export made it"):
        export_scene(scene, out)
    assert mine.read_text() == "mine" and sorted(file.name for file in out.iterdir()) == sorted(
        ("about.txt", "asset.ply", "cameras.json", "collision", "proxy.ply")
    )
    mine.unlink()
    export_scene(scene, out)


def test_a_folder_collision_that_no_export_made_is_left_alone(scene, tmp_path):
    mine = tmp_path / "package" / "collision" / "gripper.stl"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with refused(SceneError, mine.parent, "no export made it"):
        export_scene(scene, tmp_path / "package")
    assert mine.read_text() == "mine" and [one.name for one in (tmp_path / "package").iterdir()] == ["collision"]


def test_nothing_appears_when_a_part_is_damaged(scene, tmp_path):
    (scene.round_folder(0) / "proxy" / "proxy.npz").write_bytes(b"cut off")
    with refused(R2SEgoError, scene.round_folder(0) / "proxy" / "proxy.npz"):
        export_scene(scene, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("damaged", ["asset.ply", "collision/mesh.obj"])
def test_a_result_that_was_cut_off_since_is_neither_exported_nor_called_refined(scene, tmp_path, damaged):
    result = damaged.partition("/")[0]

    def same(place: Path) -> None:
        content = (scene.path / damaged).read_bytes()
        (place / "mesh.obj" if place.is_dir() else place).write_bytes(content)

    counts = ("rollouts_succeeded", "rollouts_failed", "candidates", "targets", "views_kept")
    (scene.round_folder(0) / "metrics.json").write_text(json.dumps(dict.fromkeys(counts, 1)))
    scene = scene.declare(overrides={"rounds": 1})
    Runner(scene).step(result, same)
    assert len(export_scene(scene, tmp_path / "first")) == 5
    assert describe(scene, look_at_results=True)["refined"]
    whole = (scene.path / damaged).read_bytes()
    (scene.path / damaged).write_bytes(whole[: len(whole) // 2])
    with refused(SceneError, scene.path / result, "not as it was made", cure="r2sego refine"):
        export_scene(scene, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    told = describe(scene, look_at_results=True)
    assert not told["refined"] and f"not as it was made: {result}" in lines(told)


@pytest.mark.parametrize("wrong", [{}, {"captures": []}, {"captures": 5}, {"captures": [ENTRY | {"fx": np.nan}]}])
def test_cameras_that_are_damaged_are_not_exported(scene, tmp_path, wrong):
    (scene.captures_folder / "cameras.json").write_text(json.dumps(wrong))
    with refused(CaptureError, cure="`r2sego new`") as caught:
        export_scene(scene, tmp_path / "out")
    assert "cameras.json" in caught.value.where
    assert not (tmp_path / "out" / "asset.ply").exists()


@pytest.mark.parametrize("inside", ["", "rounds/0", "collision"])
def test_a_scene_is_not_exported_into_itself(scene, inside):
    before = content_digest(scene.path)
    with refused(SceneError, scene.path / inside):
        export_scene(scene, scene.path / inside)
    assert content_digest(scene.path) == before


def test_folders_for_other_peoples_training_code_are_part_of_an_export(scene, tmp_path):
    _add_collision_surface(scene)
    written = export_scene(scene, tmp_path / "out", consumers=["mjlab", "mujoco-warp", "mjlab"])
    assert [path.name for path in written] == [*PLAIN, "mjlab", "mujoco-warp", ABOUT]
    spec = mujoco.MjSpec.from_file(str(tmp_path / "out" / "mjlab" / "scene.xml"))
    assert {geom.name for geom in spec.geoms} == {"floor", "piece_0000"}
    told = (tmp_path / "out" / ABOUT).read_text()
    assert all(name in told for name in ("mjlab", "mujoco-warp"))
    heard = ProgressRecorder()
    export_scene(scene, tmp_path / "out", progress=heard, consumers=["mjlab"])
    assert [text for text in heard.warnings if "mujoco-warp" in text and "mjlab" not in text]


def test_a_consumers_folder_that_no_export_made_is_left_alone(scene, tmp_path):
    _add_collision_surface(scene)
    kept = tmp_path / "out" / "newton" / "mine.txt"
    kept.parent.mkdir(parents=True)
    kept.write_text("mine")
    with refused(SceneError, tmp_path / "out" / "newton", "no export made it"):
        export_scene(scene, tmp_path / "out", consumers=["newton"])
    assert kept.read_text() == "mine"


def test_what_is_no_consumer_is_refused_by_name(scene, tmp_path):
    with refused(AssetError, "--for", "'isaac'", cure="playground"):
        export_scene(scene, tmp_path / "out", consumers=["isaac"])
    assert not (tmp_path / "out").exists()
