"""``cameras.json`` of the original 3D Gaussian splatting: a list, each camera as its ``camera_to_JSON`` has it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from expected_errors import refused
from splat_photographs import write_points

from r2sego_blender.captures.importing import import_captures
from r2sego_blender.captures.poses.registry import find_poses, poses_beside
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.errors import CaptureError
from r2sego_blender.core.progress import SILENT

SETTINGS = CaptureSettings()


def _poses(rng, count=4):
    return [look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3)) for _ in range(count)]


def _listed(index, pose, name):
    return {
        "id": index,
        "img_name": name,
        "width": 128,
        "height": 96,
        "position": pose[:3, 3].tolist(),
        "rotation": pose[:3, :3].tolist(),
        "fy": 101.0,
        "fx": 102.0,
    }


def _written(folder, poses, names="{}.jpg"):
    folder.mkdir(parents=True, exist_ok=True)
    listed = [_listed(i, pose, names.format(f"{i:04d}")) for i, pose in enumerate(poses)]
    (folder / "cameras.json").write_text(json.dumps(listed))
    return folder / "cameras.json"


@pytest.mark.parametrize("names", ["{}.jpg", "{}"])
@pytest.mark.parametrize("given", ["model", "model/cameras.json"])
@pytest.mark.parametrize("captures", ["room", "room/images"])
def test_cameras_are_read_as_3dgs_wrote_them(tmp_path, rng, blank_photograph, names, given, captures):
    """Of photographs at half the size that the model was trained at."""
    poses = _poses(rng)
    for i in range(4):
        blank_photograph(tmp_path / "room" / "images" / f"{i:04d}.jpg", 64, 48)
    _written(tmp_path / "model", poses, names)
    imported = import_captures(tmp_path / captures, tmp_path / given, SETTINGS)
    assert not imported.metric and len(imported.captures) == 4
    for capture, pose in zip(imported.captures, poses, strict=True):
        camera = capture.camera
        assert np.abs(camera.world_from_camera - pose).max() < 1e-9
        assert (camera.fx, camera.fy, camera.cx, camera.cy) == (51.0, 50.5, 32.0, 24.0)


def test_its_points_are_those_that_it_began_with(tmp_path, rng):
    record, place = find_poses(_written(tmp_path, _poses(rng)))
    assert record.points(place, SILENT) is None
    write_points(tmp_path / "input.ply")
    xyz, colours = record.points(place, SILENT)
    assert len(xyz) == len(colours) > 0


def test_beside_other_poses_it_comes_last(tmp_path, rng):
    """Whoever trained in the folder of a COLMAP model has both: the model counts, as before."""
    file = _written(tmp_path, _poses(rng))
    assert poses_beside(tmp_path) == [file]
    (tmp_path / "sparse" / "0").mkdir(parents=True)
    for name in ("cameras.bin", "images.bin"):
        (tmp_path / "sparse" / "0" / name).write_bytes(b"")
    assert poses_beside(tmp_path) == [tmp_path / "sparse" / "0"] == [find_poses(tmp_path)[1]]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("rotation", [[1, 0, 0], [0, 1, 0]]),
        ("rotation", [[2, 0, 0], [0, 2, 0], [0, 0, 2]]),
        ("position", [1, 2]),
        ("position", None),
        ("fx", 0),
        ("width", "wide"),
        ("img_name", ""),
    ],
)
def test_what_is_wrong_is_said(tmp_path, rng, blank_photograph, key, value):
    for i in range(4):
        blank_photograph(tmp_path / f"{i:04d}.jpg", 64, 48)
    path = _written(tmp_path, _poses(rng))
    data = json.loads(path.read_text())
    data[2][key] = value
    path.write_text(json.dumps(data))
    with refused(CaptureError, f"{path}, [2]"):
        import_captures(tmp_path, path, SETTINGS)
