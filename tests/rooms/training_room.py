"""A refined bundle of the made-up room, made without refining: what policies are trained in."""

import shutil
from pathlib import Path

from made_up_room import made_up_bundle

from r2sego_blender.splats.formats.ply import save_ply
from tools.benchmarks.workloads import made_up_room

SEAT_HEIGHT_M = 0.45
"""Of the box in the room that is a seat."""


def training_room(path: Path, gaussians: int = 4000) -> Path:
    """The bundle at ``path``: walls, a table, a shelf, and a box to sit on, in splats and as a collision surface."""
    scene = made_up_bundle(path)
    shutil.copytree(scene.round_folder(0) / "collision", scene.collision_folder)
    asset = made_up_room(gaussians, (64, 48)).asset
    for file in (scene.asset_file, scene.round_folder(0) / "asset.ply"):
        save_ply(file, asset)
    return scene.path
