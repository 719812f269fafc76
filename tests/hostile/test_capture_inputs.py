"""Captures, depth maps and a bundle's own files that others made: refused in a sentence, or read clean.

Each file in ../shared/failing/hostile once ended in a traceback, took gigabytes, or was believed.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from fake_bundle import cameras, selection, write_bundle
from PIL import Image

from r2sego_blender.bundle.journal import Journal
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frozen import load_frozen_views
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.sensors.sensor_depth import SensorDepth
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.captures.store import load_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, is_rigid
from r2sego_blender.core.errors import R2SEgoError
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb
from r2sego_blender.generation.ego_views import load_pseudo_observations
from r2sego_blender.generation.view_records import read_views
from r2sego_blender.geometry.room.completed_depth import CompletedDepth
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.views.selection import Selection, load_candidates, save_candidates

HOSTILE = Path(__file__).parents[2].parent / "shared" / "failing" / "hostile"
MOST_S = 1.0
MOST_MB = 200.0

pytestmark = pytest.mark.skipif(not HOSTILE.is_dir(), reason="../shared/failing/hostile is missing")


def hostile(*kinds: str) -> Callable:
    """A test for each of the files of these kinds."""
    files = [file for kind in kinds for file in sorted((HOSTILE / kind).glob("*"))]
    return pytest.mark.parametrize("file", files, ids=[f"{file.parent.name}-{file.name[:8]}" for file in files])


@contextlib.contextmanager
def bounded(file: Path) -> Iterator[None]:
    """Whatever is refused within is told in one line with a cure, at once, and takes little memory."""
    forget_peak_memory()
    before_mb, start_s = peak_memory_mb() or 0.0, time.process_time()
    try:
        yield
    except R2SEgoError as error:
        assert error.where and error.cure
        assert str(error).isprintable() and len(str(error)) < 2500
    assert time.process_time() - start_s <= MOST_S
    assert (peak_memory_mb() or 0.0) - before_mb <= max(MOST_MB, 10.0 * file.stat().st_size / 2**20)


def require_clean(cameras: Sequence[Camera]) -> None:
    for camera in cameras:
        assert is_rigid(camera.world_from_camera)
        assert min(camera.fx, camera.fy, camera.width, camera.height) > 0
        assert np.isfinite([camera.fx, camera.fy, camera.cx, camera.cy]).all()


def place(file: Path, at: Path) -> None:
    at.parent.mkdir(parents=True, exist_ok=True)
    at.write_bytes(file.read_bytes())


@pytest.fixture
def photographs(tmp_path):
    """A folder as the hostile pose files name it: six photographs and their polycam names."""
    for index in range(6):
        for name in (f"images/c{index}.png", f"images/capture_0{index}.png", f"frozen/f{index}.png"):
            (tmp_path / name).parent.mkdir(exist_ok=True)
            Image.new("RGB", (64, 48), (index, 0, 0)).save(tmp_path / name)
    return tmp_path


@hostile("cameras.json", "transforms.json")
def test_poses_of_a_file(photographs, file):
    poses = photographs / file.parent.name
    place(file, poses)
    with bounded(file):
        require_clean([one.camera for one in import_captures(photographs, poses, CaptureSettings()).captures])


@hostile("frozen")
def test_frozen_views(photographs, file):
    place(file, photographs / "cameras.json")
    with bounded(file):
        require_clean([view.camera for view in load_frozen_views(photographs / "cameras.json")])


@hostile("polycam")
def test_a_raw_export_of_polycam(tmp_path, file):
    sound = '{"t_00":1,"t_01":0,"t_02":0,"t_03":%d,"t_10":0,"t_11":1,"t_12":0,"t_13":0,"t_20":0,"t_21":0,'
    sound += '"t_22":1,"t_23":0,"fx":38.1,"fy":38.1,"cx":32,"cy":24,"width":64,"height":48}'
    keyframes = tmp_path / "keyframes"
    for name in ("images", "cameras"):
        (keyframes / name).mkdir(parents=True)
    for index in range(4):
        Image.new("RGB", (64, 48), (index, 0, 0)).save(keyframes / "images" / f"{index}.jpg")
        (keyframes / "cameras" / f"{index}.json").write_text(sound % index)
    place(file, keyframes / "cameras" / "2.json")
    with bounded(file):
        require_clean([one.camera for one in import_captures(tmp_path, None, CaptureSettings()).captures])


@hostile("colmap-txt-images")
def test_a_colmap_model(photographs, file):
    model = photographs / "sparse" / "0"
    place(file, model / "images.txt")
    (model / "cameras.txt").write_text("1 PINHOLE 160 120 95.25 95.25 80 60\n")
    with bounded(file):
        captures = import_captures(photographs / "images", model, CaptureSettings()).captures
        require_clean([one.camera for one in captures])


@hostile("depth.png", "depth.npz", "depthc.npz")
def test_a_depth_map(tmp_path, file):
    at = tmp_path / f"c{file.suffix}"
    place(file, at)
    capture = Capture("c.png", tmp_path / "c.png", Camera(32, 24, 20.0, 20.0, 16.0, 12.0, np.eye(4)))
    with bounded(file):
        depth = SensorDepth(tmp_path).of(capture, "c")
        assert depth is not None and np.isfinite(depth).all() and (depth >= 0).all()


@hostile("bundle_captures_cameras.json")
def test_the_captures_of_a_bundle(tmp_path, file):
    bundle = write_bundle(tmp_path / "b.r2s")
    place(file, bundle / "captures" / "cameras.json")
    for index in range(6):
        Image.new("RGB", (160, 120)).save(bundle / "captures" / "images" / f"capture_0{index}.png")
    with bounded(file):
        require_clean([one.camera for one in load_captures(bundle / "captures")])


@hostile("bundle_captures_sparse.npz")
def test_the_sparse_points_of_a_bundle(file):
    with bounded(file):
        sparse = SparsePoints.load(file)
        assert np.isfinite(sparse.points).all() and np.isfinite(sparse.pixels[sparse.visibility]).all()


@hostile("bundle_geometry_completed_capture_00.png.npz")
def test_a_completed_depth_of_a_bundle(file):
    with bounded(file):
        completed = CompletedDepth.load(file)
        require_clean([completed.camera])
        assert np.isfinite(completed.depth).all() and (completed.depth >= 0).all()


@hostile("bundle_geometry_planes.npz")
def test_the_planes_of_a_bundle(file):
    with bounded(file):
        planes = RoomPlanes.load(file)
        assert np.isfinite(planes.offsets).all()
        np.testing.assert_allclose(np.linalg.norm(planes.normals, axis=1), 1.0, atol=2e-3)


@hostile("bundle_rounds_0_selection_candidates.json", "bundle_rounds_0_selection_candidates.npz")
def test_the_candidates_of_a_bundle(tmp_path, file):
    save_candidates(tmp_path, cameras()[:1] * 82)
    place(file, tmp_path / file.name.rpartition("-")[2])
    with bounded(file):
        require_clean(load_candidates(tmp_path))


@hostile("bundle_rounds_0_selection_selection.json", "bundle_rounds_0_selection_selection.npz")
def test_the_selection_of_a_bundle(tmp_path, file):
    selection().save(tmp_path)
    place(file, tmp_path / file.name.rpartition("-")[2])
    with bounded(file):
        found = Selection.load(tmp_path)
        for share in (found.deficit, found.availability, found.score):
            assert ((share >= 0.0) & (share <= 1.001)).all()


@hostile("bundle_rounds_0_views_000_pose.json")
def test_the_views_of_a_bundle(tmp_path, file):
    views = write_bundle(tmp_path / "b.r2s") / "rounds" / "0" / "views"
    place(file, views / "000" / "pose.json")
    for read in (lambda: read_views(views, 3), lambda: load_pseudo_observations(views)):
        with bounded(file):
            read()


@hostile("bundle_journal.jsonl")
def test_the_journal_of_a_bundle(tmp_path, file):
    place(file, tmp_path / "journal.jsonl")
    with bounded(file):
        Journal(tmp_path).steps()
