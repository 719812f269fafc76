"""Which of several photographs of one name a pose file means."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.importing import import_captures
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at

SETTINGS = CaptureSettings()
GL = np.diag([1.0, -1.0, -1.0, 1.0])


def _poses(rng, count):
    return [look_at(rng.uniform([-2, -2, 1], [2, 2, 5]), rng.uniform(-1, 1, 3)) for _ in range(count)]


@pytest.mark.parametrize("kind", ["transforms.json", "cameras.json", "cameras.json of 3DGS"])
def test_the_photographs_of_the_named_folder_are_taken_before_those_beside_the_poses(
    tmp_path, rng, blank_photograph, kind
):
    """As where somebody brightened them: the poses are still those of the originals, which lie where they were."""
    paths = [blank_photograph(tmp_path / "images" / f"p{i}.png", 64, 48) for i in range(3)]
    poses = _poses(rng, 3)
    brightened = [blank_photograph(tmp_path / "brightened" / path.name, 64, 48) for path in paths]
    if kind == "transforms.json":
        listed = [
            {"file_path": f"images/{path.name}", "transform_matrix": (pose @ GL).tolist()}
            for path, pose in zip(paths, poses, strict=True)
        ]
        file = tmp_path / "transforms.json"
        file.write_text(json.dumps({"fl_x": 50.0, "w": 64, "h": 48, "frames": listed}))
    else:
        cameras = [Camera(64, 48, 50.0, 50.0, 32.0, 24.0, pose) for pose in poses]
        file = tmp_path / "cameras.json"
        save_cameras_json(file, [Capture(p.name, p, c) for p, c in zip(paths, cameras, strict=True)])
    if kind == "cameras.json of 3DGS":
        turned = [{"position": pose[:3, 3].tolist(), "rotation": pose[:3, :3].tolist()} for pose in poses]
        lens = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0}
        file.write_text(json.dumps([{"id": i, "img_name": paths[i].name} | lens | one for i, one in enumerate(turned)]))
        for path in paths:
            path.rename(tmp_path / path.name)
    imported = import_captures(tmp_path / "brightened", file, SETTINGS)
    assert [capture.image_path for capture in imported.captures] == brightened


def test_a_rig_in_cameras_json_is_not_mixed_up_by_its_file_names(tmp_path, rng, blank_photograph):
    paths = [blank_photograph(tmp_path / f"cam{k}" / f"{i}.png", 64, 48) for k in range(2) for i in range(2)]
    cameras = [Camera(64, 48, 50.0, 50.0, 32.0, 24.0, pose) for pose in _poses(rng, 4)]
    file = tmp_path / "cameras.json"
    save_cameras_json(file, [Capture(str(p), p, c) for p, c in zip(paths, cameras, strict=True)])
    imported = import_captures(tmp_path / "cam0", file, SETTINGS)
    assert [capture.image_path for capture in imported.captures] == paths
