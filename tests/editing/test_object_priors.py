"""Objects declared in a bundle: masks, a library, meshes and poses held by hand."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from bundles import new_bundle
from click.testing import CliRunner

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.commands.cli import main
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import GeometryError, R2SEgoError, SceneError
from r2sego_blender.core.images import save_image
from r2sego_blender.editing.object_priors import declare_objects, describe_objects, lines, move_objects
from r2sego_blender.geometry.objects.objects import load_objects
from r2sego_blender.geometry.stereo.observed_geometry import ObservedGeometry


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    captures = []
    for index in range(3):
        path = tmp_path / f"p{index}.png"
        save_image(path, np.full((60, 80, 3), 0.5, np.float32))
        camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, look_at((index - 1.0, -2, 1.4), (0, 0.5, 0.4)))
        captures.append(Capture(path.name, path, camera))

    def fill(folder: Path) -> None:
        (folder / "captures").mkdir()
        save_captures(folder / "captures", captures)

    return new_bundle(tmp_path / "room.r2s", fill)


@pytest.fixture
def masks(tmp_path: Path) -> Path:
    """A chair drawn in two photographs, a table in one."""
    for name, views in (("chair", (0, 2)), ("table", (1,))):
        (tmp_path / "masks" / name).mkdir(parents=True)
        for view in views:
            mask = np.zeros((60, 80), np.uint8)
            mask[20 : 30 + view, 10:40] = 255
            cv2.imwrite(str(tmp_path / "masks" / name / f"p{view}.png"), mask)
    return tmp_path / "masks"


@pytest.fixture
def library(tmp_path: Path) -> Path:
    (tmp_path / "library").mkdir()
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "library" / "box.ply")
    return tmp_path / "library"


def _objects(scene: Scene) -> dict:
    return {one.name: one for one in load_objects(scene.path / "objects", load_captures(scene.captures_folder))}


def _as_if_run(scene: Scene, pose: np.ndarray) -> None:
    """The record that aligning leaves."""
    folder = scene.path / "geometry" / "priors"
    folder.mkdir(parents=True)
    record = {"name": "chair", "refusal": "", "backend": "mesh", "shape": "box", "energy": 0.2}
    record["silhouette_iou"] = 0.9
    (folder / "priors.json").write_text(json.dumps([record | {"world_from_own": pose.tolist()}]))


def test_masks_and_library_are_declared_and_told(scene, masks, library):
    declared = declare_objects(scene, masks=masks, library=library)
    assert Path(declared.declaration.mesh_library) == library
    assert Scene.open(scene.path).declaration.mesh_library == str(library)
    objects = _objects(scene)
    assert {name: len(one.masks) for name, one in objects.items()} == {"chair": 2, "table": 1}
    assert objects["chair"].masks["p2.png"].sum() == 12 * 30
    told = lines(describe_objects(scene))
    assert len(told) == 3 and all("not run yet" in line for line in told[1:])


def test_an_alignment_is_locked_with_its_mesh_and_let_go(scene, masks, library):
    declare_objects(scene, masks=masks, library=library)
    pose = np.diag([0.5, 0.5, 0.5, 1.0])
    pose[:3, 3] = 0.1, 0.2, 0.3
    _as_if_run(scene, pose)
    declare_objects(Scene.open(scene.path), lock=["chair"])
    held = _objects(scene)["chair"]
    assert held.placement.locked and held.mesh.name == "mesh.ply"
    np.testing.assert_array_equal(held.placement.world_from_own, pose)
    assert len(trimesh.load(held.mesh).faces) == 12
    assert any("aligned, locked" in line for line in lines(describe_objects(scene)))
    declare_objects(Scene.open(scene.path), unlock=["chair"])
    assert _objects(scene)["chair"].placement is None


@pytest.mark.parametrize("asked", [{"lock": ["chair"]}, {"find": True}, {"vocabulary": ["chair"]}])
def test_what_was_made_in_an_earlier_world_frame_is_not_used(scene, masks, library, asked):
    declare_objects(scene, masks=masks, library=library)
    _as_if_run(scene, np.eye(4))
    record = (scene.path / "geometry/priors/priors.json").read_text()
    Runner(scene).step("geometry/priors", lambda folder: (folder / "priors.json").write_text(record))
    Runner(scene).step("geometry/completed", lambda folder: (folder / "p0.png.npz").touch())
    Runner(scene).step("geometry/observed.npz", lambda file: file.touch())
    larger = tuple(map(tuple, np.diag([1.1, 1.1, 1.1, 1.0]).tolist()))
    corrected = Scene.open(scene.path).declare(world_from_capture=larger)
    with pytest.raises(SceneError, match="was corrected since it was made"):
        declare_objects(corrected, **asked)
    assert _objects(scene)["chair"].placement is None


def test_what_symmetry_completed_is_called_so_and_cannot_be_held(scene, masks, library):
    declare_objects(scene, masks=masks, library=library)
    _as_if_run(scene, np.eye(4))
    record = {"name": "chair", "refusal": "", "backend": "symmetry", "no_mesh": "none fits", "energy": 0.2}
    (scene.path / "geometry" / "priors" / "priors.json").write_text(json.dumps([record]))
    told = next(line for line in lines(describe_objects(scene)) if line.startswith("chair"))
    assert "(symmetry)" in told and "without a mesh" in told and "aligned" not in told
    with pytest.raises(GeometryError, match="completed by its symmetry"):
        declare_objects(Scene.open(scene.path), lock=["chair"])


def test_backends_are_told_and_a_mesh_by_hand_replaces_a_made_one(scene, masks, library):
    declare_objects(scene, masks=masks)
    made = {"masks": "SAM 3 0.1.0", "mesh": "SAM 3D Objects 0.0.1"}
    (scene.path / "objects" / "chair" / "backends.json").write_text(json.dumps(made))
    told = next(line for line in lines(describe_objects(scene)) if line.startswith("chair"))
    assert "masks by SAM 3 0.1.0, mesh by SAM 3D Objects 0.0.1" in told
    declare_objects(Scene.open(scene.path), meshes={"chair": library / "box.ply"})
    assert dict(_objects(scene)["chair"].backends) == {"masks": "SAM 3 0.1.0"}


@pytest.mark.parametrize("options", [["--segment", "chair, table"], ["--generate", "chair"]])
def test_a_learned_backend_that_is_not_set_up_changes_nothing(scene, masks, monkeypatch, options):
    for variable in ("R2SEGO_SAM3_PYTHON", "R2SEGO_SAM3D_PYTHON"):
        monkeypatch.delenv(variable, raising=False)
    declare_objects(scene, masks=masks)
    (scene.path / "geometry").mkdir()
    empty = np.zeros((1, 3), np.float32)
    observed = ObservedGeometry(empty, empty, empty, np.ones((1, 3), bool), np.ones(1, np.float32))
    observed.save(scene.path / "geometry" / "observed.npz")
    result = CliRunner().invoke(main, ["objects", str(scene.path), *options])
    assert result.exit_code != 0 and "is not set up on this machine" in result.output
    assert set(_objects(scene)) == {"chair", "table"}


def test_words_need_observed_points(scene):
    with pytest.raises(GeometryError, match="nothing is observed yet"):
        declare_objects(scene, vocabulary=["chair"])


def test_poses_held_by_hand_move_with_the_world(scene, masks, library):
    declare_objects(scene, masks=masks, library=library)
    _as_if_run(scene, np.eye(4))
    declare_objects(Scene.open(scene.path), lock=["chair"])
    similarity = np.diag([2.0, 2.0, 2.0, 1.0])
    similarity[:3, 3] = 1, 0, -1
    move_objects(scene, similarity)
    objects = _objects(scene)
    np.testing.assert_allclose(objects["chair"].placement.world_from_own, similarity)
    assert objects["chair"].placement.locked and objects["table"].placement is None
    assert len(objects["chair"].masks) == 2


def test_a_mesh_of_its_own_is_copied_into_the_bundle(scene, masks, library):
    declare_objects(scene, masks=masks, meshes={"table": library / "box.ply"})
    assert _objects(scene)["table"].mesh.parent == scene.path / "objects" / "table"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"lock": ["lamp"]}, "there is no object 'lamp'.*chair, table"),
        ({"lock": ["chair"]}, "no alignment yet.*refine"),
        ({"library": Path("nowhere")}, "no such folder"),
        ({"masks": Path("nowhere")}, "no such folder"),
        ({"find": True}, "no depth yet"),
    ],
)
def test_what_cannot_be_done_is_refused_and_changes_nothing(scene, masks, wrong, message):
    declare_objects(scene, masks=masks)
    before = {path: path.read_bytes() for path in (scene.path / "objects").rglob("*.png")}
    with pytest.raises(GeometryError, match=message):
        declare_objects(Scene.open(scene.path), **wrong)
    assert {path: path.read_bytes() for path in (scene.path / "objects").rglob("*.png")} == before


def test_a_damaged_mesh_is_refused_before_the_next_run(scene, masks, tmp_path):
    declare_objects(scene, masks=masks)
    (tmp_path / "broken.glb").write_bytes(b"glTF but not really")
    with pytest.raises(R2SEgoError, match=r"broken\.glb"):
        declare_objects(Scene.open(scene.path), meshes={"chair": tmp_path / "broken.glb"})
    assert _objects(scene)["chair"].mesh is None


def test_the_command_declares_and_describes(scene, masks, library):
    command = ["objects", str(scene.path), "--masks", str(masks), "--library", str(library), "--json"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0, result.output
    assert [one["name"] for one in json.loads(result.output)] == ["chair", "table"]
    refused = CliRunner().invoke(main, ["objects", str(scene.path), "--mesh", "chair"])
    assert refused.exit_code == 1 and "--mesh NAME=FILE" in refused.output


def test_a_pose_by_hand_takes_the_mesh_of_the_last_run(scene, masks, library, tmp_path):
    declare_objects(scene, masks=masks, library=library)
    pose = np.diag([0.5, 0.5, 0.5, 1.0])
    (tmp_path / "pose.json").write_text(json.dumps({"world_from_own": pose.tolist(), "locked": True}))
    with pytest.raises(GeometryError, match=r"'chair' has no mesh to place.*--mesh chair=FILE"):
        declare_objects(Scene.open(scene.path), place={"chair": tmp_path / "pose.json"})
    _as_if_run(scene, np.eye(4))
    declare_objects(Scene.open(scene.path), place={"chair": tmp_path / "pose.json"})
    held = _objects(scene)["chair"]
    assert held.mesh.name == "mesh.ply" and held.placement.locked
    np.testing.assert_array_equal(held.placement.world_from_own, pose)
    (tmp_path / "pose.json").write_text("{}")
    with pytest.raises(GeometryError, match=r"pose\.json: this is no placement"):
        declare_objects(Scene.open(scene.path), place={"chair": tmp_path / "pose.json"})


def test_decisions_are_kept_told_and_taken_back(scene, masks):
    declare_objects(scene, masks=masks)
    command = ["objects", str(scene.path), "--reject", "chair", "--accept", "table"]
    told = CliRunner().invoke(main, command).output
    assert "rejected by a person" in told and "accepted by a person" in told
    assert {name: one.decision for name, one in _objects(scene).items()} == {"chair": "reject", "table": "accept"}
    declare_objects(Scene.open(scene.path), reconsider=["chair"])
    assert not (scene.path / "objects/chair/decision.json").exists()
    (scene.path / "objects/table/decision.json").write_text('{"decision": "perhaps"}')
    with pytest.raises(GeometryError, match=r"decision\.json: this is no decision"):
        _objects(scene)


def test_new_masks_keep_what_else_is_known_of_an_object(scene, masks, library):
    declare_objects(scene, masks=masks, meshes={"chair": library / "box.ply"}, reject=["chair"])
    cv2.imwrite(str(masks / "chair" / "p1.png"), np.full((60, 80), 255, np.uint8))
    declare_objects(Scene.open(scene.path), masks=masks)
    chair = _objects(scene)["chair"]
    assert len(chair.masks) == 3 and chair.mesh.name == "mesh.ply" and chair.decision == "reject"


@pytest.mark.parametrize(
    "given",
    [
        {"accept": ["chair"], "reject": ["chair"]},
        {"reject": ["chair"], "reconsider": ["chair"]},
        {"lock": ["chair"], "unlock": ["chair"]},
        {"place": {"chair": Path("pose.json")}, "unlock": ["chair"]},
        {"find": True, "masks": Path("masks")},
        {"vocabulary": ["chair"], "masks": Path("masks")},
    ],
)
def test_what_contradicts_itself_is_refused_and_changes_nothing(scene, masks, tmp_path, given):
    declare_objects(scene, masks=masks)
    _as_if_run(scene, np.eye(4))
    (tmp_path / "pose.json").write_text(json.dumps({"world_from_own": np.eye(4).tolist()}))
    before = content_digest(scene.path / "objects")
    given |= {"masks": masks} if "masks" in given else {}
    given |= {"place": {"chair": tmp_path / "pose.json"}} if "place" in given else {}
    with pytest.raises(GeometryError, match=r"r2sego objects: .*Give one"):
        declare_objects(scene, **given)
    assert content_digest(scene.path / "objects") == before


def test_objects_are_taken_away_the_last_one_too(scene, masks, library, tmp_path):
    declare_objects(scene, masks=masks, library=library, meshes={"chair": library / "box.ply"})
    command = ["objects", str(scene.path), "--remove"]
    refused = CliRunner().invoke(main, [*command, "sofa"])
    assert refused.exit_code == 1 and "there is no object 'sofa'" in refused.output
    assert set(_objects(scene)) == {"chair", "table"}
    assert CliRunner().invoke(main, [*command, "table"]).exit_code == 0
    (chair,) = _objects(scene).values()
    assert chair.name == "chair" and len(chair.masks) == 2 and chair.mesh.is_file()
    last = CliRunner().invoke(main, [*command, "chair", "--json"])
    assert last.exit_code == 0 and json.loads(last.output) == []
    assert _objects(scene) == {} and not (scene.path / "objects").exists()
    assert "no objects are declared" in CliRunner().invoke(main, ["objects", str(scene.path)]).output
    # Nothing can be said of it any more.
    with pytest.raises(GeometryError, match=r"no object 'chair'.*Give its masks first"):
        declare_objects(scene, remove=["chair"], reject=["chair"])
    declare_objects(scene, masks=masks)
    assert set(_objects(scene)) == {"chair", "table"}


def test_a_library_is_withdrawn_and_objects_that_hold_its_meshes_keep_them(scene, masks, library):
    scene = declare_objects(scene, masks=masks, library=library)
    _as_if_run(scene, np.eye(4))
    with pytest.raises(GeometryError, match="library"):
        declare_objects(scene, library=library, no_library=True)
    left = declare_objects(scene, lock=["chair"], no_library=True)
    assert left.declaration.mesh_library == Scene.open(scene.path).declaration.mesh_library == ""
    assert _objects(scene)["chair"].mesh is not None and _objects(scene)["table"].mesh is None
    result = CliRunner().invoke(main, ["objects", str(scene.path), "--no-library"])
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("words", ["", " , "])
def test_no_words_to_segment_are_refused(scene, words):
    result = CliRunner().invoke(main, ["objects", str(scene.path), "--segment", words])
    assert result.exit_code != 0 and "--segment" in result.output
