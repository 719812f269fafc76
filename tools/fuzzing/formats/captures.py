"""Poses that photographs come with, points and picks."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.progress import SILENT

from ..harness import Harness
from ..seeds import NAMES, camera, of_tests, photographs

_GL = np.diag([1.0, -1.0, -1.0, 1.0])


def _posed(folder: Path) -> Any:
    """The poses as ``r2sego new`` takes them, and their points."""
    return _read_poses(folder / "poses", folder)


def _read_poses(poses: Path, folder: Path) -> Any:
    from r2sego_blender.captures.poses.photographs import captures_of
    from r2sego_blender.captures.poses.registry import find_poses

    record, place = find_poses(poses)
    posed = record.read(place, folder, CaptureSettings(), SILENT)
    points = record.points(place, SILENT) if record.points else None
    return posed.photographs, captures_of(posed.photographs, 64), points


def _transforms(folder: Path) -> None:
    photographs(folder)
    (folder / "poses").mkdir()
    frames = [
        {"file_path": f"../{name}", "transform_matrix": (camera(i).world_from_camera @ _GL).tolist()}
        for i, name in enumerate(NAMES)
    ]
    for name in NAMES:
        (folder / "poses" / name).write_bytes((folder / name).read_bytes())
    told = {"w": 32, "h": 24, "fl_x": 25.0, "fl_y": 25.0, "cx": 16.0, "cy": 12.0, "k1": 0.01, "p1": 0.001}
    table = told | {"camera_model": "OPENCV", "ply_file_path": "points.ply", "frames": frames}
    (folder / "poses/transforms.json").write_text(json.dumps(table))
    _points_ply(folder / "poses/points.ply")


def _points_ply(file: Path) -> None:
    lines = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {axis}" for axis in "xyz")]
    lines += [*(f"property uchar {colour}" for colour in ("red", "green", "blue")), "end_header"]
    lines += [f"{i} {i / 2} 1.5 {10 * i} 20 30" for i in range(4)]
    file.write_text("\n".join(lines) + "\n")


def _listed(number: int, name: str) -> dict[str, Any]:
    return {"file": name, **camera(number).to_json()}


def _cameras(folder: Path) -> None:
    photographs(folder)
    (folder / "poses").mkdir()
    entries = [_listed(i, name) for i, name in enumerate(NAMES)]
    (folder / "poses/cameras.json").write_text(json.dumps({"metric": True, "captures": entries, "frozen": entries}))
    for name in NAMES:
        (folder / "poses" / name).write_bytes((folder / name).read_bytes())


def _of_3dgs(folder: Path) -> None:
    photographs(folder)
    (folder / "poses").mkdir()
    listed = []
    for i, name in enumerate(NAMES):
        (folder / "poses" / name).write_bytes((folder / name).read_bytes())
        pose = camera(i).world_from_camera
        places = {"position": pose[:3, 3].tolist(), "rotation": pose[:3, :3].tolist()}
        listed.append({"id": i, "img_name": name, "width": 32, "height": 24, **places, "fy": 25.0, "fx": 25.0})
    (folder / "poses/cameras.json").write_text(json.dumps(listed))
    _points_ply(folder / "poses/input.ply")


def _frozen(folder: Path) -> Any:
    from r2sego_blender.captures.frozen import load_frozen_views

    return load_frozen_views(folder / "poses/cameras.json")


def _polycam(folder: Path) -> None:
    keyframes = folder / "poses/keyframes"
    for name in ("images", "cameras"):
        (keyframes / name).mkdir(parents=True)
    photographs(keyframes / "images")
    for i, name in enumerate(NAMES):
        pose = camera(i).world_from_camera @ _GL
        rows = {f"t_{r}{c}": float(pose[r, c]) for r in range(3) for c in range(4)}
        lens = {"fx": 25.0, "fy": 25.0, "cx": 16.0, "cy": 12.0, "width": 32, "height": 24}
        (keyframes / "cameras" / f"{Path(name).stem}.json").write_text(json.dumps(rows | lens))


def _record3d(folder: Path) -> None:
    (folder / "poses/rgb").mkdir(parents=True)
    photographs(folder / "poses/rgb")
    for index, name in enumerate(NAMES):
        (folder / "poses/rgb" / name).rename(folder / "poses/rgb" / f"{index}{Path(name).suffix}")
    poses = [[0.1, 0.2 * i, 0.0, 0.97, 0.1 * i, 0.0, 1.5] for i in range(len(NAMES))]
    lens = {"w": 32, "h": 24, "K": [25.0, 0, 0, 0, 25.0, 0, 16.0, 12.0, 1]}
    own = {"perFrameIntrinsicCoeffs": [[25.0, 25.0, 16.0, 12.0]] * len(NAMES)}
    (folder / "poses/metadata.json").write_text(json.dumps({**lens, **own, "poses": poses}))


def _stray_scanner(folder: Path) -> None:
    of_tests("phone_recordings").stray_scanner(folder / "poses", list(map(camera, range(3))), _far)
    photographs(folder)
    for index, name in enumerate(NAMES):
        (folder / name).rename(folder / f"{index:06d}{Path(name).suffix}")


def _stray_scanner_of_one_lens(folder: Path) -> None:
    _stray_scanner(folder)
    odometry = folder / "poses/odometry.csv"
    lines = [",".join(line.split(",")[:9]) for line in odometry.read_text().splitlines()]
    odometry.write_text("\n".join(lines))


def _three_d_scanner_app(folder: Path) -> None:
    images = [np.full((24, 32, 3), 40 * i, np.uint8) for i in range(3)]
    of_tests("phone_recordings").three_d_scanner_app(folder / "poses", list(map(camera, range(3))), images, _far)


def _scan_zip(folder: Path) -> None:
    _three_d_scanner_app(folder)
    shutil.make_archive(str(folder / "scan"), "zip", folder / "poses")
    shutil.rmtree(folder / "poses")


def _unpacked(folder: Path) -> Any:
    from r2sego_blender.captures.archives import unpack

    with tempfile.TemporaryDirectory(dir=folder) as place:
        return _read_poses(unpack(folder / "scan.zip", Path(place), SILENT), Path(place))


def _far(view: Camera) -> np.ndarray:
    return np.full(view.shape, 2.0)


def _semantic_nerf(folder: Path) -> None:
    of_tests("dataset_folders").semantic_nerf(folder / "poses", 4)


def _nice_slam(folder: Path) -> None:
    of_tests("dataset_folders").nice_slam(folder / "poses", 4)
    lens = {"w": 120, "h": 68, "fx": 60.0, "fy": 60.0, "cx": 59.5, "cy": 33.5, "scale": 6553.5}
    (folder / "poses/cam_params.json").write_text(json.dumps({"camera": lens}))


def _seven_scenes(folder: Path) -> None:
    of_tests("dataset_folders").seven_scenes(folder / "poses", frames=2)


def _sparse() -> SparsePoints:
    points = np.random.default_rng(1).uniform((-0.2, 0.2, 0.4), (0.4, 0.8, 1.0), (6, 3))
    cameras: list[Camera] = [camera(i) for i in range(3)]
    places = np.stack([one.project(points)[0] for one in cameras], axis=1).astype(np.float32)
    return SparsePoints(points, np.full((6, 3), 99, np.uint8), np.ones((6, 3), bool), np.zeros(6), places)


def _colmap_text(folder: Path) -> None:
    from r2sego_blender.captures.poses.colmap_model import save_colmap_model

    photographs(folder)
    captures = [Capture(name, folder / name, camera(i)) for i, name in enumerate(NAMES)]
    save_colmap_model(folder / "poses", captures, _sparse())


def _colmap_binary(folder: Path) -> None:
    import pycolmap

    _colmap_text(folder)
    model = pycolmap.Reconstruction(folder / "poses")
    for file in (folder / "poses").iterdir():
        file.unlink()
    model.write_binary(folder / "poses")


def _colmap_points(folder: Path) -> Any:
    from r2sego_blender.captures.poses.colmap_points import read_colmap_points

    return read_colmap_points(folder / "poses")


def _colmap_files(folder: Path) -> Any:
    """What is looked over before COLMAP reads the files."""
    from r2sego_blender.captures.poses import colmap_files as files

    place = folder / "poses"
    if (place / "cameras.bin").is_file():
        files.check_cameras(place / "cameras.bin")
        files.check_images(place / "images.bin")
    else:
        files.check_cameras_text(place / "cameras.txt")
        files.check_images_text(place / "images.txt")


def _of_colmap(build: Callable[[Path], None], suffix: str, kind: str) -> Sequence[Harness]:
    for_points = Harness(f"poses/points3D{suffix}", build, f"poses/points3D{suffix}", kind, _colmap_points)
    checked = [
        Harness(f"poses/checked-{name}{suffix}", build, f"poses/{name}{suffix}", kind, _colmap_files, share=0.5)
        for name in ("cameras", "images")
    ]
    whole = [
        Harness(f"poses/{name}{suffix}", build, f"poses/{name}{suffix}", kind, _posed, share=0.03)
        for name in ("cameras", "images")
    ]
    return [for_points, *checked, *whole]


def _picks(folder: Path) -> None:
    from r2sego_blender.captures.frame.picks import CameraHeight, Pick, PickedLength, PickedPoint, Picks

    views = (Pick("a.png", 3.0, 4.0), Pick("b.png", 5.0, 6.0))
    points = (PickedPoint("p", views, True), PickedPoint("q", views))
    picks = Picks(points, (PickedLength("p", "q", 1.5),), (CameraHeight("a.png", 1.4),))
    (folder / "picks.json").write_text(json.dumps(picks.to_json()))


def _read_picks(folder: Path) -> Any:
    from r2sego_blender.captures.frame.picks import Picks

    return Picks.load(folder / "picks.json")


def _ply(folder: Path) -> None:
    _points_ply(folder / "points.ply")


def _read_ply(folder: Path) -> Any:
    from r2sego_blender.captures.poses.ply_points import read_ply_points

    return read_ply_points(folder / "points.ply")


HARNESSES = (
    Harness("poses/transforms.json", _transforms, "poses/transforms.json", "json", _posed),
    Harness("poses/cameras.json", _cameras, "poses/cameras.json", "json", _posed),
    Harness("poses/3dgs-cameras.json", _of_3dgs, "poses/cameras.json", "json", _posed),
    Harness("poses/frozen.json", _cameras, "poses/cameras.json", "json", _frozen),
    Harness("poses/polycam.json", _polycam, "poses/keyframes/cameras/b.json", "json", _posed),
    Harness("poses/record3d.json", _record3d, "poses/metadata.json", "json", _posed),
    Harness("poses/odometry.csv", _stray_scanner, "poses/odometry.csv", "text", _posed),
    Harness("poses/camera_matrix.csv", _stray_scanner_of_one_lens, "poses/camera_matrix.csv", "text", _posed),
    Harness("poses/3d-scanner-app.json", _three_d_scanner_app, "poses/frame_00002.json", "json", _posed),
    Harness("poses/scan.zip", _scan_zip, "scan.zip", "bytes", _unpacked, share=0.3),
    Harness("poses/traj_w_c.txt", _semantic_nerf, "poses/traj_w_c.txt", "text", _posed),
    Harness("poses/traj.txt", _nice_slam, "poses/traj.txt", "text", _posed),
    Harness("poses/cam_params.json", _nice_slam, "poses/cam_params.json", "json", _posed),
    Harness("poses/frame.pose.txt", _seven_scenes, "poses/seq-01/frame-000001.pose.txt", "text", _posed),
    Harness("poses/TrainSplit.txt", _seven_scenes, "poses/TrainSplit.txt", "text", _posed),
    *_of_colmap(_colmap_text, ".txt", "text"),
    *_of_colmap(_colmap_binary, ".bin", "bytes"),
    Harness("poses/points.ply", _ply, "points.ply", "text", _read_ply),
    Harness("poses/picks.json", _picks, "picks.json", "json", _read_picks),
)
