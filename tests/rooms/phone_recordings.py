"""Recordings with poses and LiDAR depth, in the layouts in which apps of phones write them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera

ARKIT_FROM_ROOM = np.array([[1.0, 0, 0, 0.3], [0, 0, 1, -1.2], [0, -1, 0, 0.8], [0, 0, 0, 1]])
"""ARKit's world has +Y up."""

DEPTH_SHARE = 0.64
"""How much smaller depth is than photographs."""

_GL = np.diag([1.0, -1.0, -1.0, 1.0])
_HEADER = "timestamp, frame, x, y, z, qx, qy, qz, qw"
_OF_FRAMES = ", fx, fy, cx, cy, distortion_center_x, distortion_center_y"


def stray_scanner(
    folder: Path, cameras: Sequence[Camera], depth: Callable[[Camera], np.ndarray], lens_of_frames: bool = True
) -> Path:
    """All of a recording but ``rgb.mp4``; the file of poses. Where depth is odd in millimetres confidence is 0."""
    lines = [_HEADER + (_OF_FRAMES if lens_of_frames else "")]
    for number, camera in enumerate(cameras):
        pose = ARKIT_FROM_ROOM @ camera.world_from_camera
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
        numbers = [170.0 + number / 60.0, f"{number:06d}", *pose[:3, 3].tolist(), *turn.tolist()]
        if lens_of_frames:
            numbers += [camera.fx, camera.fy, camera.cx, camera.cy, "", ""]
        lines.append(", ".join(map(str, numbers)))
        _save_depth(folder / "depth" / f"{number:06d}.png", folder / "confidence" / f"{number:06d}.png", camera, depth)
    one = cameras[-1]
    rows = ([one.fx, 0.0, one.cx], [0.0, one.fy, one.cy], [0.0, 0.0, 1.0])
    (folder / "camera_matrix.csv").write_text("\n".join(", ".join(map(str, row)) for row in rows))
    (folder / "odometry.csv").write_text("\n".join(lines) + "\n")
    return folder / "odometry.csv"


def three_d_scanner_app(
    folder: Path, cameras: Sequence[Camera], images: Sequence[np.ndarray], depth: Callable[[Camera], np.ndarray]
) -> Path:
    """An export in which every second frame alone has its photograph; the folder. ``images`` are of those."""
    folder.mkdir(parents=True, exist_ok=True)
    for index, (camera, image) in enumerate(zip(cameras, images, strict=True)):
        pose = ARKIT_FROM_ROOM @ camera.world_from_camera @ _GL
        matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
        about = {"cameraPoseARFrame": pose.ravel().tolist(), "intrinsics": matrix, "motionQuality": 1}
        for number in (2 * index, 2 * index + 1):
            text = json.dumps({**about, "frame_index": number, "time": 170.0 + number / 60.0})
            (folder / f"frame_{number:05d}.json").write_text(text)
            files = (folder / f"{kind}_{number:05d}.png" for kind in ("depth", "conf"))
            _save_depth(*files, camera, depth)
        Image.fromarray(image).save(folder / f"frame_{2 * index:05d}.jpg", quality=95)
    (folder / "info.json").write_text(json.dumps({"appVersion": "2.5"}))
    Image.fromarray(images[0]).save(folder / "thumb_00.jpg")
    return folder


def _save_depth(file: Path, confidence: Path, camera: Camera, depth: Callable[[Camera], np.ndarray]) -> None:
    for one in (file, confidence):
        one.parent.mkdir(parents=True, exist_ok=True)
    millimetres = np.round(1000.0 * depth(camera.scaled(DEPTH_SHARE))).astype(np.uint16)
    Image.fromarray(millimetres).save(file)
    Image.fromarray(np.where(millimetres % 2, 0, 2).astype(np.uint8)).save(confidence)
