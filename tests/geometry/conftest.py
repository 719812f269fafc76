"""A made-up room with exact depth, normals and pictures, for the geometry tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from painted_room import BOX_HIGH, BOX_LOW, LENS, SIZE_M, paint, room_mesh

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.stereo.stereo import DepthMap
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer


@dataclass(frozen=True)
class Room:
    """A closed room x in [-2, 2], y in [-1.5, 1.5], z in [0, 2.4] with one box on its floor.

    ``mesh`` faces free space; ``captures`` look at the far wall (y = 1.5) and the box.
    """

    mesh: trimesh.Trimesh
    captures: tuple[Capture, ...]
    depth_maps: tuple[DepthMap, ...]

    @staticmethod
    def distance(points: np.ndarray) -> np.ndarray:
        """(...,) distance from points (..., 3) to the nearest wall, floor, ceiling or box side."""
        half = SIZE_M / 2
        shell = (half - np.abs(points - (0, 0, half[2]))).min(-1)
        centre, reach = (BOX_LOW + BOX_HIGH) / 2, (BOX_HIGH - BOX_LOW) / 2
        away = np.abs(points - centre) - reach
        box = np.linalg.norm(np.maximum(away, 0), axis=-1) + np.minimum(away.max(-1), 0)
        return np.minimum(np.abs(shell), np.abs(box))

    @staticmethod
    def colour(points: np.ndarray) -> np.ndarray:
        """(..., 3) in [0, 1]: what the captures show of surface points (..., 3)."""
        return paint(points)


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Room:
    folder = tmp_path_factory.mktemp("room")
    mesh = room_mesh()
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    normals = np.asarray(mesh.face_normals, np.float32)
    captures, maps = [], []
    for index, x in enumerate((-1.4, -0.5, 0.4, 1.3)):
        pose = look_at((x, -1.2, 1.5), (0.3 * x, 1.0, 0.5))
        camera = LENS.at(pose)
        buffers = rasterizer.render(camera)
        path = folder / f"{index}.png"
        save_image(path, paint(camera.unproject(buffers.depth)).astype(np.float32))
        captures.append(Capture(f"{index}", path, camera))
        cost = np.full(camera.shape, 0.05, np.float32)
        support = np.full(camera.shape, 2, np.uint8)
        maps.append(DepthMap(buffers.depth, buffers.of_face(normals), cost, support, camera))
    return Room(mesh, tuple(captures), tuple(maps))


@pytest.fixture(scope="session")
def observed_points(room: Room) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """``observed_points(noise_m, outliers)``: what the captures saw, points and normals."""

    def points(noise_m: float = 0.0, outliers: int = 0) -> tuple[np.ndarray, np.ndarray]:
        rng = np.random.default_rng(2)
        seen = np.concatenate([d.camera.unproject(d.depth)[::2, ::2].reshape(-1, 3) for d in room.depth_maps])
        normals = np.concatenate([d.normal[::2, ::2].reshape(-1, 3) for d in room.depth_maps])
        seen += rng.normal(size=seen.shape) * noise_m
        wrong = rng.uniform(-1, 1, (outliers, 3)) * SIZE_M / 2 + (0, 0, SIZE_M[2] / 2)
        turned = rng.normal(size=(outliers, 3))
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-9)
        return np.concatenate([seen, wrong]), np.concatenate([normals, turned])

    return points
