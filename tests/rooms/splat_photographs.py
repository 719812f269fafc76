"""Photographs of a made-up room, its points and poses, for training splats on them alone."""

import json
from pathlib import Path

import numpy as np
import trimesh

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.config.presets import UNREGULARISED, with_overrides
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.splats.rendering.rasterizer import render
from tools.benchmarks.workloads import made_up_room

SETTINGS = with_overrides(
    {
        **{f"training.{key}": value for key, value in UNREGULARISED.items()},
        "training.steps_per_round": 60,
        "training.sh_degree": 1,
        "training.every_third_pixel_share": 0.6,
        "training.every_second_pixel_share": 0.3,
    }
)
ROOM = made_up_room(1500, (96, 72))


def captures_in(folder: Path, unit_m: float = 1.0, count: int = 6) -> list[Capture]:
    """Renderings of the room from places a step apart; the poses' unit is ``unit_m`` metres."""
    folder.mkdir(parents=True, exist_ok=True)
    captures = []
    for index in range(count):
        camera = ROOM.views[0].camera.at(look_at(np.array([-1.5 + 0.25 * index, 1.6, 1.5]), (0.6, -0.5, 0.8)))
        path = folder / f"photo{index}.png"
        save_image(path, render(ROOM.asset, camera).colour)
        scale = np.diag([1.0 / unit_m] * 3 + [1.0])
        captures.append(Capture(path.name, path, camera.transformed(scale)))
    return captures


def room_points(unit_m: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    colours = np.clip(ROOM.asset.base_colours * 255.0, 0, 255).astype(np.uint8)
    return ROOM.asset.means.astype(np.float64) / unit_m, colours


def sparse_points(captures: int) -> SparsePoints:
    points, colours = room_points()
    seen = np.ones((len(points), captures), bool)
    pixels = np.zeros((len(points), captures, 2), np.float32)
    return SparsePoints(points, colours, seen, np.ones(len(points)), pixels)


def write_points(path: Path, unit_m: float = 1.0) -> Path:
    trimesh.PointCloud(*room_points(unit_m)).export(path)
    return path


def write_transforms(path: Path, captures: list[Capture], **more: object) -> None:
    """A transforms.json as nerfstudio and Blender's synthetic scenes have it: OpenGL axes."""
    camera = captures[0].camera
    frames = [
        {
            "file_path": f"./{c.image_path.relative_to(path.parent).with_suffix('')}",
            "transform_matrix": (c.camera.world_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist(),
        }
        for c in captures
    ]
    lens = {"camera_angle_x": 2.0 * np.arctan(camera.width / 2.0 / camera.fx)}
    path.write_text(json.dumps({**lens, "frames": frames, **more}))
