"""The step that aligns a bundle's declared objects: what it publishes and what runs it again."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bundles import new_bundle
from painted_room import BOX_HIGH, BOX_LOW

from r2sego_blender.bundle.runner import Runner
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import CAPTURES, save_captures
from r2sego_blender.core.progress import SILENT
from r2sego_blender.editing.object_priors import declare_objects
from r2sego_blender.geometry.objects.objects import OBJECTS, DeclaredObject, Placement, save_objects
from r2sego_blender.geometry.objects.prior_files import PRIOR_RECORDS, PRIORS
from r2sego_blender.geometry.room.completed_depth import COMPLETED
from r2sego_blender.geometry.room.planes import PLANES, RoomPlanes
from r2sego_blender.geometry.stereo.observed import observe
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED
from r2sego_blender.geometry.stereo.stereo import DEPTH
from r2sego_blender.refine import capture_steps
from r2sego_blender.refine.capture_steps import RegisteredCaptures
from r2sego_blender.refine.steps import Steps

SMALL = {"training.backdrop_gaussians": 0, "proxy.planes": 4}


def room_planes() -> RoomPlanes:
    normals = np.concatenate([np.eye(3), -np.eye(3)])[[2, 0, 1, 3, 4, 5]]
    offsets = np.array([0.0, -2.0, -1.5, -2.0, -1.5, -2.4])
    return RoomPlanes(normals, offsets, np.full(6, 1000), np.ones(6, bool))


@pytest.fixture(scope="module")
def crate() -> trimesh.Trimesh:
    """The box on the room's floor."""
    return trimesh.creation.box(bounds=(BOX_LOW, BOX_HIGH))


def registered(path: Path, room, captures: Sequence[Capture]) -> Scene:
    """A bundle with captures and the room's sparse points, as the registration leaves it."""

    def fill(folder):
        (folder / "captures").mkdir()
        depths = [depth.camera.unproject(depth.depth)[::40, ::40] for depth in room.depth_maps]
        points = np.concatenate(depths).reshape(-1, 3)
        seen = np.ones((len(points), 4), bool)
        pixels = np.stack([depth.camera.project(points)[0] for depth in room.depth_maps], 1)
        sparse = SparsePoints(
            points, np.zeros(points.shape, np.uint8), seen, np.zeros(len(points)), pixels.astype(np.float32)
        )
        save_captures(folder / "captures", captures, sparse)

    return new_bundle(path, fill, overrides=SMALL)


@pytest.fixture(scope="module")
def scene(room, tmp_path_factory) -> Scene:
    """A bundle with captures, exact depth, observed points and planes, as the steps before leave it."""
    scene = registered(tmp_path_factory.mktemp("priors") / "room.r2s", room, room.captures)
    captures = scene.read(CAPTURES)
    (scene.path / DEPTH.name).mkdir(parents=True)
    for capture, depth in zip(captures, room.depth_maps, strict=True):
        depth.save(scene.path / DEPTH.name / f"{capture.name}.npz")
    settings = scene.declaration.settings
    observe(captures, room.depth_maps, None, settings.stereo).save(scene.path / OBSERVED.name)
    room_planes().save(scene.path / PLANES.name)
    return scene


@pytest.fixture(scope="module")
def masks(scene, room) -> dict[str, np.ndarray]:
    """Where the captures show the crate."""
    found = {}
    for capture, depth in zip(scene.read(CAPTURES), room.depth_maps, strict=True):
        points = depth.camera.unproject(depth.depth)
        low, high = np.array([0.4, 0.5, 1e-3]), np.array([1.4, 1.1, 0.7])
        found[capture.name] = ((points > low - 1e-3) & (points < high + 1e-3)).all(-1)
    return found


def run(scene: Scene) -> list[dict]:
    Steps(Runner(scene), scene.declaration.settings, SILENT).align_priors(RegisteredCaptures(), OBSERVED, PLANES)
    return scene.read(PRIOR_RECORDS)


def runs(scene: Scene) -> int:
    return sum(record.get("step") == PRIORS.name for record in scene.journal())


def test_objects_are_aligned_and_only_when_something_changed(scene, masks, crate, tmp_path):
    assert run(scene) == []
    assert scene.read(PRIORS) == ()

    mesh = tmp_path / "crate.ply"
    crate.export(mesh)
    held = DeclaredObject("crate", masks, mesh, Placement(np.eye(4), locked=True))
    save_objects(scene.path / OBJECTS.name, [held], list(masks))
    (record,) = run(scene)
    assert record["refusal"] == "" and record["silhouette_iou"] > 0.9 and record["point_distance_m"] < 0.01
    (prior,) = scene.read(PRIORS)
    assert prior.name == "crate"
    np.testing.assert_allclose(np.sort(prior.vertices, axis=0), np.sort(crate.vertices, axis=0), atol=1e-6)

    before = runs(scene)
    assert run(scene) == [record] and runs(scene) == before == 2
    nowhere = {name: np.zeros_like(mask) for name, mask in masks.items()}
    save_objects(scene.path / OBJECTS.name, [DeclaredObject("ghost", nowhere)], list(masks))
    crate_record, ghost = run(scene)
    assert crate_record == record and runs(scene) == 3
    assert ghost["refusal"] == "no mask shows the object"
    assert [one.name for one in scene.read(PRIORS)] == ["crate"]

    declare_objects(scene, remove=["crate", "ghost"])
    assert run(scene) == [] and runs(scene) == 4
    assert scene.read(PRIORS) == ()


def test_the_captures_of_a_rig_may_repeat_their_file_names(room, tmp_path, monkeypatch):
    """Named by paths, even absolute ones, their depth lies in the bundle all the same."""
    names = ["cam0/0000.png", "cam1/0000.png", str(tmp_path / "cam2" / "0000.png"), "left.png"]
    captures = [replace(one, name=name) for one, name in zip(room.captures, names, strict=True)]
    scene = registered(tmp_path / "rig.r2s", room, captures)
    monkeypatch.setattr(capture_steps, "dense_stereo", lambda *_, **__: room.depth_maps)
    steps = Steps(Runner(scene), scene.declaration.settings, SILENT)
    captures, _ = steps.register_inputs()
    steps.align_priors(captures, *steps.observed_and_prior_geometry(captures))
    for target in (DEPTH, COMPLETED):
        files = [path.name for path in sorted((scene.path / target.name).iterdir())]
        assert len(files) == 4 and files[:2] == ["cam0_0000.png.npz", "cam1_0000.png.npz"]
        assert "left.png.npz" in files
    assert [path.name for path in tmp_path.iterdir()] == ["rig.r2s"]
    for made in (DEPTH, COMPLETED):
        read = scene.read(made).of(scene.read(CAPTURES))
        assert [one.camera.to_json() for one in read] == [one.camera.to_json() for one in room.depth_maps]


def test_a_library_that_is_changed_runs_the_step_again(scene, masks, crate, tmp_path):
    library = tmp_path / "library"
    library.mkdir()
    declared = scene.declare(mesh_library=str(library))
    assert Scene.open(scene.path).declaration == declared.declaration
    save_objects(scene.path / OBJECTS.name, [DeclaredObject("box", masks)], list(masks))
    crate.export(library / "crate.ply")
    found = {record["name"]: record for record in run(declared)}
    assert found["box"]["shape"] == "crate" and found["box"]["silhouette_iou"] > 0.85
    before = runs(scene)
    run(declared)
    assert runs(scene) == before
    crate.apply_scale(2.0).export(library / "crate.ply")
    run(declared)
    assert runs(scene) == before + 1


def test_objects_that_are_withdrawn_leave_nothing_to_redo(scene, masks, crate, tmp_path):
    """Nor does the library that nobody looks in any more, and that may be gone."""
    shutil.rmtree(scene.path / OBJECTS.name, ignore_errors=True)
    run(scene)
    before = runs(scene)
    library = tmp_path / "library"
    library.mkdir()
    crate.export(library / "crate.ply")
    declared = scene.declare(mesh_library=str(library))
    save_objects(scene.path / OBJECTS.name, [DeclaredObject("box", masks)], list(masks))
    declare_objects(declared, remove=["box"])
    assert run(declared) == [] and runs(scene) == before
    (library / "crate.ply").unlink()
    assert run(declared) == [] and runs(scene) == before


def test_bounds_that_are_changed_run_the_step_again(scene):
    run(scene)
    before = runs(scene)
    planes = room_planes()
    planes.bounding[-1] = False
    planes.save(scene.path / PLANES.name)
    run(scene)
    assert runs(scene) == before + 1


def test_a_bundle_from_before_there_were_libraries_has_none(scene):
    file = scene.path / "scene.toml"
    text = file.read_text().replace("[priors]", "[no_priors]")
    file.write_text(text)
    assert Scene.open(scene.path).declaration.mesh_library == ""
