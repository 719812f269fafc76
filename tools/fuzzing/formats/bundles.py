"""What a bundle holds, through the artifacts' own loaders: captures, geometry, assets and records."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.bundle import figures, layout
from r2sego_blender.bundle.artifacts import Artifact
from r2sego_blender.bundle.scene import Scene
from r2sego_blender.core.errors import SceneError

from ..harness import Harness
from ..seeds import camera, of_tests

BUNDLE = "a.r2s"


def build(folder: Path) -> None:
    """The bundle that the tests write, with what they leave out."""
    from r2sego_blender.captures.sensors.sensor_maps import SensorMap
    from r2sego_blender.geometry.estimators.aligned_depth import AlignedDepth
    from r2sego_blender.geometry.estimators.estimated_depth import EstimatedDepth
    from r2sego_blender.geometry.room.completed_depth import CompletedDepth
    from r2sego_blender.geometry.room.planes import RoomPlanes
    from r2sego_blender.geometry.stereo.stereo import DepthMap
    from r2sego_blender.splats.asset_edits import AssetEdit, save_edit
    from r2sego_blender.splats.regions import Box, Cells, Lasso
    from r2sego_blender.workers.signed_records import write_signed

    path = of_tests("fake_bundle").write_bundle(folder / BUNDLE)
    scene, lens = Scene.open(path), camera()
    depth = np.full(lens.shape, 2.0, np.float32)
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), (*lens.shape, 3))
    for name in ("depth", "completed"):
        (path / "geometry" / name).mkdir()
    known = depth > 0
    DepthMap(depth, up, depth * 0, known.astype(np.uint8), lens, known).save(path / "geometry/depth/a.png.npz")
    (path / layout.SENSOR_DEPTH).mkdir()
    SensorMap(depth, 0.01 * depth, lens).save(path / layout.SENSOR_DEPTH / "a.png.npz")
    CompletedDepth(depth, (depth > 0).astype(np.uint8), lens).save(path / "geometry/completed/a.png.npz")
    estimated = np.full(lens.shape, 5, np.uint8)
    CompletedDepth(depth, estimated, lens, depth / 4).save(path / "geometry/completed/b.png.npz")
    for name in (layout.ESTIMATES, layout.ESTIMATED):
        (path / name).mkdir()
    EstimatedDepth(depth, depth / 2).save(path / layout.ESTIMATES / "a.png.npz")
    AlignedDepth(depth, depth / 40, lens).save(path / layout.ESTIMATED / "a.png.npz")
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    RoomPlanes(normals, np.array([0.0, -1.5]), np.array([50, 40]), np.array([True, True])).save(path / layout.PLANES)
    corners = np.array([[3.0, 3.0], [20.0, 4.0], [10.0, 20.0]])
    regions = (Box(np.eye(4), np.ones(3)), Lasso(lens, corners, 0.1, 3.0), Cells.around(corners @ np.eye(2, 3), 0.1))
    save_edit(scene, AssetEdit("edit_001", regions))
    crate = path / "objects/crate"
    pose = of_tests("fake_proxy").CRATE_FROM_OWN.tolist()
    (crate / "placement.json").write_text(json.dumps({"world_from_own": pose, "locked": True}))
    (crate / "decision.json").write_text(json.dumps({"decision": "accept"}))
    (crate / "backends.json").write_text(json.dumps({"masks": "by hand", "mesh": "by hand"}))
    one = {"new_from_old": np.eye(4).tolist(), "world_from_capture": np.eye(4).tolist(), "made": {"captures": "0" * 64}}
    (path / "corrections.json").write_text(json.dumps([one | {"ground": "floor", "scale_source": "metric"}]))
    for name in ("captures", layout.OBSERVED, "rounds/0/proxy"):
        scene.note(step=name, inputs="0" * 64, output="1" * 64, seconds=1.5)
    (path / ".jobs/one").mkdir(parents=True)
    record = {"format": 1, "title": "Refine", "command": ["python", "-m", "r2sego_blender", "refine"], "started": 1.5}
    record |= {"machine": "here", "notes": {}, "starter": {"pid": 1, "birth": "2"}}
    _configure(folder)
    write_signed(path / ".jobs/one/job.json", record)
    events = [{"event": "progress", "done": 1, "total": 2}, {"event": "result", "data": 3.5}]
    (path / ".jobs/one/events.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events))


def _artifact(artifact: Callable[[], Artifact[Any]]) -> Callable[[Path], Any]:
    return lambda folder: Scene.open(folder / BUNDLE).read(artifact())


def _of(kind: str, name: str, file: str, read: Callable[[Path], Any]) -> Harness:
    return Harness(f"bundle/{name}", build, f"{BUNDLE}/{file}", kind, read)


def _captures() -> Artifact[Any]:
    from r2sego_blender.captures.store import CAPTURES

    return CAPTURES


def _sparse() -> Artifact[Any]:
    from r2sego_blender.captures.sparse_points import SPARSE

    return SPARSE


def _observed() -> Artifact[Any]:
    from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED

    return OBSERVED


def _planes() -> Artifact[Any]:
    from r2sego_blender.geometry.room.planes import PLANES

    return PLANES


def _priors() -> Artifact[Any]:
    from r2sego_blender.geometry.objects.prior_files import PRIORS

    return PRIORS


def _edits() -> Artifact[Any]:
    from r2sego_blender.geometry.proxy.edits import PROXY_EDITS

    return PROXY_EDITS


def _asset_edits() -> Artifact[Any]:
    from r2sego_blender.splats.asset_edits import ASSET_EDITS

    return ASSET_EDITS


def _refined_asset() -> Artifact[Any]:
    from r2sego_blender.splats.artifacts import REFINED_ASSET

    return REFINED_ASSET


def _depth(folder: Path) -> Any:
    from r2sego_blender.geometry.stereo.stereo import DEPTH

    held = Scene.open(folder / BUNDLE).read(DEPTH)
    return held.load(held.folder / "a.png.npz")


def _sensor_depth(folder: Path) -> Any:
    from r2sego_blender.captures.sensors.sensor_maps import SENSOR_DEPTH

    held = Scene.open(folder / BUNDLE).read(SENSOR_DEPTH)
    return held.load(held.folder / "a.png.npz")


def _estimates(folder: Path) -> Any:
    from r2sego_blender.geometry.estimators.estimated_depth import ESTIMATES

    held = Scene.open(folder / BUNDLE).read(ESTIMATES)
    return held.load(held.folder / "a.png.npz")


def _estimated(folder: Path) -> Any:
    from r2sego_blender.geometry.estimators.aligned_depth import ESTIMATED

    held = Scene.open(folder / BUNDLE).read(ESTIMATED)
    return held.load(held.folder / "a.png.npz")


def _completed(folder: Path, file: str = "a.png.npz") -> Any:
    from r2sego_blender.geometry.room.completed_depth import COMPLETED

    held = Scene.open(folder / BUNDLE).read(COMPLETED)
    return held.load(held.folder / file)


def _completed_by_estimates(folder: Path) -> Any:
    return _completed(folder, "b.png.npz")


def _known_objects(folder: Path) -> Any:
    """As Blender lists them, with their records, decisions and placements."""
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.proxy_objects import read_objects

    return read_objects(Bundle.open(folder / BUNDLE))


def _objects(folder: Path) -> Any:
    from r2sego_blender.geometry.objects.objects import OBJECTS

    scene = Scene.open(folder / BUNDLE)
    return scene.read(OBJECTS).of(scene.read(_captures()))


def _journal(folder: Path) -> Any:
    from r2sego_blender.bundle.frames import frames_of

    scene = Scene.open(folder / BUNDLE)
    return scene.journal(), scene.recorded(), scene.outputs(), frames_of(scene.journal())


def _corrections(folder: Path) -> Any:
    from r2sego_blender.captures.frame.correction_history import corrections_of

    return corrections_of(folder / BUNDLE)


def _scores(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.report_scores import report_scores

    return report_scores(Bundle.open(folder / BUNDLE))


def _robot_facts(folder: Path) -> Any:
    from r2sego_blender.results.panels.bundle import Bundle
    from r2sego_blender.results.panels.robot_facts import RobotFacts

    facts = RobotFacts.read(Bundle.open(folder / BUNDLE))
    return facts.told, facts.seats, list(facts.lines())


def _configure(folder: Path) -> None:
    """The secret that signs jobs lies here, and not where the person's is."""
    os.environ["R2SEGO_CONFIG"] = str(folder / "config")


def _jobs(folder: Path) -> Any:
    from r2sego_blender.workers.jobs import Job

    _configure(folder)
    job = Job.open(folder / BUNDLE / ".jobs/one")
    return job.title, job.command, job.running(), job.events(), job.words()


def _collision(folder: Path) -> Any:
    from r2sego_blender.geometry.collision.collision_files import read_obj
    from r2sego_blender.geometry.objects.prior_files import AlignedPrior

    return AlignedPrior("collision", *read_obj(folder / BUNDLE / "collision/mesh.obj"))


def _cut_off(folder: Path) -> None:
    """A small bundle that was ended as several of its parts took their places."""
    scene = of_tests("bundles").new_bundle(folder / BUNDLE)
    (scene.path / ".changes").mkdir()
    (scene.path / ".changes/parts.json").write_text(json.dumps(["scene.toml", "captures"]))


def _finished(folder: Path) -> Any:
    """A copy of it, whose parts are put in their places as whoever locks it does, and then has to begin anew."""
    copy = folder / "copy.r2s"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder / BUNDLE, copy)
    try:
        with Scene.open(copy).locked():
            pass
    except SceneError:
        if (copy / ".changes").exists():
            raise
    return sorted(str(file.relative_to(copy)) for file in copy.rglob("*"))


HARNESSES = (
    Harness("bundle/changes/parts.json", _cut_off, f"{BUNDLE}/.changes/parts.json", "json", _finished),
    _of("text", "collision/mesh.obj", "collision/mesh.obj", _collision),
    _of("json", "captures/cameras.json", "captures/cameras.json", _artifact(_captures)),
    _of("json", "registered/cameras.json", "captures/cameras.json", _artifact(lambda: figures.CAMERAS)),
    _of("npz", "captures/sparse.npz", "captures/sparse.npz", _artifact(_sparse)),
    _of("npz", "geometry/observed.npz", layout.OBSERVED, _artifact(_observed)),
    _of("npz", "geometry/planes.npz", layout.PLANES, _artifact(_planes)),
    _of("npz", "geometry/depth.npz", "geometry/depth/a.png.npz", _depth),
    _of("npz", "captures/depth.npz", f"{layout.SENSOR_DEPTH}/a.png.npz", _sensor_depth),
    _of("npz", "geometry/completed.npz", "geometry/completed/a.png.npz", _completed),
    _of("npz", "geometry/completed-estimated.npz", "geometry/completed/b.png.npz", _completed_by_estimates),
    _of("npz", "estimates/depth.npz", f"{layout.ESTIMATES}/a.png.npz", _estimates),
    _of("npz", "geometry/estimated.npz", f"{layout.ESTIMATED}/a.png.npz", _estimated),
    _of("npz", "geometry/prior.npz", "geometry/priors/crate.npz", _artifact(_priors)),
    _of("json", "geometry/priors.json", "geometry/priors/priors.json", _known_objects),
    _of("npz", "geometry/edit.npz", "geometry/edits/hole.npz", _artifact(_edits)),
    _of("json", "objects/placement.json", "objects/crate/placement.json", _objects),
    _of("json", "objects/shown-placement.json", "objects/crate/placement.json", _known_objects),
    _of("json", "objects/decision.json", "objects/crate/decision.json", _objects),
    _of("json", "objects/backends.json", "objects/crate/backends.json", _objects),
    _of("png", "objects/mask.png", "objects/crate/masks/capture_1.png", _objects),
    _of("header", "asset.ply", "asset.ply", _artifact(_refined_asset)),
    _of("json", "asset_edits.json", "asset_edits/edit_001.json", _artifact(_asset_edits)),
    _of("lines", "journal.jsonl", "journal.jsonl", _journal),
    _of("json", "corrections.json", "corrections.json", _corrections),
    _of("json", "report/metrics.json", "report/metrics.json", _scores),
    _of("json", "robot/robot.json", "robot/robot.json", _robot_facts),
    _of("json", "jobs/job.json", ".jobs/one/job.json", _jobs),
    _of("lines", "jobs/events.jsonl", ".jobs/one/events.jsonl", _jobs),
)
