"""A refined bundle of the made-up room, made without refining: what policies are trained in."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from made_up_room import made_up_bundle

from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField, texel_counts, texel_middles
from r2sego_blender.splats.formats.ply import save_ply
from tools.benchmarks.workloads import made_up_collision, made_up_proxy, made_up_room

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


def reference_room(folder: Path, raised_m: float = 0.0) -> Path:
    """The same room as a reference room in ``folder``, its seat higher by ``raised_m``."""

    def raised(vertices: np.ndarray) -> np.ndarray:
        is_seat = np.abs(vertices[:, 2] - SEAT_HEIGHT_M) < 1e-6
        return np.where(is_seat[:, None] & [False, False, True], vertices + raised_m, vertices).astype(vertices.dtype)

    proxy, collision = made_up_proxy(1), made_up_collision()
    vertices = raised(proxy.vertices)
    texels = texel_counts(vertices, proxy.faces, 0.2)
    middles, _ = texel_middles(vertices, proxy.faces, texels)
    light = np.zeros((len(middles), 4, 3), np.float32)
    light[:, 0], light[:, 1:] = 1.8 + 0.5 * np.sin(3.0 * middles), 0.05
    folder.mkdir(parents=True)
    SurfaceLightField(vertices, proxy.faces, texels, light, np.zeros(3, np.float32)).save(folder / "light.npz")
    pieces = tuple((raised(corners), faces) for corners, faces in collision.pieces)
    write_collision(replace(collision, pieces=pieces), folder / "collision")
    return folder
