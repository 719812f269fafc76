"""Six captures around a room that hardly overlap, and frozen views, with their ground truth.

    python -m tools.rooms.around --room demo --to DIR [--data ../shared/scenes] [--width 400] [--samples 8]

``--data`` is the folder of ``hotel_room.glb`` and ``aws_small_house.glb``, for the rooms made of these.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

from .folder import View, seen_view, write_room
from .free_floor import free_floor
from .placing import captures_around, farthest_views

FOCAL = 26.0 / 36.0
"""Focal length over width: of a phone's main camera, and near to that of a robot's head, 69 degrees across."""

FROZEN = 8
SEED = 40


def main() -> None:
    """Build, place, render and write one room."""
    from . import pictures, scenes  # Blender is not there for those who only read this

    options = parse_options(tuple(scenes.ROOMS))
    started_s = time.monotonic()
    scene = scenes.ROOMS[options.room](options.data)
    truth = scene.truth
    room = MeshRasterizer(truth.vertices, truth.faces)
    floor = free_floor(truth.vertices, truth.faces, scene.low, scene.high)
    lens = lens_of(options.width)
    captures = captures_around(room, floor, lens)
    frozen = farthest_views(room, floor, captures, FROZEN, SEED)
    print(f"placed after {time.monotonic() - started_s:.0f} s", flush=True)
    pictures.set_up(lens, options.samples)
    folder: Path = options.to
    views: dict[str, list[View]] = {"photographs": [], "frozen": []}
    for kind, stem, cameras in (("photographs", "capture", captures), ("frozen", "frozen", frozen)):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for index, camera in enumerate(cameras):
            name = f"{stem}_{index:02d}"
            pictures.photograph(camera, folder / kind / f"{name}.png")
            views[kind].append(seen_view(name, camera, room, truth))
    told = {"room": options.room, "samples": options.samples, "seconds": round(time.monotonic() - started_s)}
    info = write_room(folder, truth, {"around": views["photographs"]}, views["frozen"], told)
    print(f"{folder}: overlap {info['overlap']:.1%}, support gap {info['support_gap']:.1%}, {info['seconds']} s")


def lens_of(width: int) -> Camera:
    """The lens at a width in pixels, 4:3, at no place yet."""
    height = width * 3 // 4
    return Camera(width, height, FOCAL * width, FOCAL * width, width / 2, height / 2, np.eye(4))


def parse_options(rooms: tuple[str, ...]) -> argparse.Namespace:
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--room", choices=rooms, required=True)
    parser.add_argument("--to", type=Path, required=True, help="the folder to make")
    parser.add_argument("--data", type=Path, default=Path("../shared/scenes"), help="where the meshes lie")
    parser.add_argument("--width", type=int, default=400, help="pixels across")
    parser.add_argument("--samples", type=int, default=8, help="Cycles samples a pixel")
    return parser.parse_args()


if __name__ == "__main__":
    main()
