"""Small scenes in the layouts in which other people's data sets are passed on, with poses that are known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.poses.colmap_model import save_colmap_model
from r2sego_blender.core.cameras import Camera, look_at

SIZE = (16, 12)
_GL = np.diag([1.0, -1.0, -1.0, 1.0])


def pose(number: int) -> np.ndarray:
    """``world_from_camera`` (4, 4) of a frame of a walk around a room."""
    angle = 0.01 * number
    return look_at((2.0 * np.cos(angle), 2.0 * np.sin(angle), 1.5), (0.1, 0.2, 0.8))


def picture(file: Path, number: int, size: tuple[int, int] = SIZE) -> None:
    """A picture of which no two numbers have the same."""
    file.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.full((size[1], size[0], 3), (number % 251, number // 251, 77), np.uint8)
    Image.fromarray(pixels).save(file)


def _matrix(number: int) -> str:
    return " ".join(f"{value:.18e}" for value in pose(number).ravel())


def semantic_nerf(walk: Path, frames: int, kept: Sequence[int] = ()) -> Path:
    """``rgb/rgb_0.png`` and so on, or those ``kept``, with poses of all ``frames``; the file of poses."""
    for number in kept or range(frames):
        picture(walk / f"rgb/rgb_{number}.png", number)
    (walk / "traj_w_c.txt").write_text("".join(f"{_matrix(number)}\n" for number in range(frames)))
    return walk / "traj_w_c.txt"


def nice_slam(walk: Path, frames: int, size: tuple[int, int] = (120, 68)) -> Path:
    """``results/frame000000.jpg`` and so on with the depth beside them; the file of poses."""
    for number in range(frames):
        picture(walk / f"results/frame{number:06d}.jpg", number, size)
        Image.fromarray(np.full((size[1], size[0]), 6553, np.uint16)).save(walk / f"results/depth{number:06d}.png")
    (walk / "traj.txt").write_text("".join(f"{_matrix(number)} \n" for number in range(frames)))
    return walk / "traj.txt"


def seven_scenes(scene: Path, frames: int = 4, train: Sequence[int] = (1, 3), test: Sequence[int] = (2,)) -> Path:
    """Sequences of so many frames, numbers of which are 100 apart; the folder of the scene."""
    for sequence in (*train, *test):
        for frame in range(frames):
            stem, number = scene / f"seq-{sequence:02d}/frame-{frame:06d}", 100 * sequence + frame
            picture(stem.with_name(f"{stem.name}.color.png"), number, (640, 480))
            depth = np.full((480, 640), 65535, np.uint16)
            depth[100:, :] = 1000 + number
            Image.fromarray(depth).save(stem.with_name(f"{stem.name}.depth.png"))
            rows = ["\t ".join(f"{value:.9e}" for value in row) + "\t \n" for row in pose(number)]
            stem.with_name(f"{stem.name}.pose.txt").write_text("".join(rows))
    for name, sequences in (("TrainSplit.txt", train), ("TestSplit.txt", test)):
        (scene / name).write_text("".join(f"sequence{one}\r\n" for one in sequences))
    return scene


def scannetpp(scene: Path, train: int = 6, test: int = 2, images: str = "resized_images") -> Path:
    """A fisheye's photographs with ``test_frames``; the file of poses."""
    entries = []
    for number in range(train + test):
        name = f"DSC{number:05d}.JPG"
        picture(scene / "dslr" / images / name, number, (48, 32))
        entries.append({"file_path": name, "transform_matrix": (pose(number) @ _GL).tolist(), "is_bad": False})
    lens = {"w": 48, "h": 32, "fl_x": 22.0, "fl_y": 22.0, "cx": 24.0, "cy": 16.0}
    distortion = {"k1": -0.03, "k2": 0.004, "k3": 0.001, "k4": 0.0, "camera_model": "OPENCV_FISHEYE"}
    undistorted = "undistorted" in images
    distortion = {"camera_model": "PINHOLE"} if undistorted else distortion
    file = scene / "dslr/nerfstudio" / f"transforms{'_undistorted' if undistorted else ''}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    frames = {"frames": entries[:train][::-1], "test_frames": entries[train:]}
    file.write_text(json.dumps({**lens, **distortion, **frames}))
    return file


def colmap_split(scene: Path, learnt: Sequence[int], held_out: Sequence[int], way: str) -> Path:
    """A COLMAP folder whose split is ``apart``, ``test.txt``, ``lists`` of both or ``json``; the folder."""
    everywhere = [*learnt, *held_out]
    models = {"sparse/0": learnt, "sparse/test": held_out} if way == "apart" else {"sparse/0": everywhere}
    for model, numbers in models.items():
        images = scene / ("images_test" if model.endswith("test") else "images")
        captures = []
        for number in numbers:
            picture(images / f"rgb_{number}.png", number)
            camera = Camera(*SIZE, 8.0, 8.0, 8.0, 6.0, pose(number))
            captures.append(Capture(f"rgb_{number}.png", images / f"rgb_{number}.png", camera))
        (scene / model).mkdir(parents=True)
        save_colmap_model(scene / model, captures, None)
    train, test = ([f"rgb_{number}.png" for number in numbers] for numbers in (learnt, held_out))
    if way == "test.txt":
        (scene / "sparse/0/test.txt").write_text("\n".join(test))
    elif way == "lists":
        (scene / "train.txt").write_text("".join(f"images/{name}\n" for name in train))
        (scene / "test.txt").write_text("".join(f"{Path(name).stem}\n" for name in test))
    elif way == "json":
        (scene / "train_test_lists.json").write_text(json.dumps({"train": train, "test": test, "has_masks": False}))
    return scene
