"""A painted room with a box in it, and a rendered scene of it with its truth, as the benchmarks take them."""

from pathlib import Path

import numpy as np
import trimesh
from cameras_file import save_cameras_json
from room_meshes import closed_room

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

CAPTURES = 4
SIZE_M = np.array([4.0, 3.0, 2.4])
BOX_LOW, BOX_HIGH = np.array([0.4, 0.5, 0.0]), np.array([1.4, 1.1, 0.7])
LENS = Camera(160, 120, 105.0, 105.0, 80.0, 60.0, np.eye(4))


def room_mesh() -> trimesh.Trimesh:
    """Closed, x in [-2, 2], y in [-1.5, 1.5], z in [0, 2.4]; the box's 12 faces are the last."""
    return closed_room(SIZE_M, (BOX_LOW, BOX_HIGH))


def paint(points: np.ndarray) -> np.ndarray:
    """A smooth, non-repeating colour for points (..., 3): (..., 3) in [0, 1]."""
    rng = np.random.default_rng(11)
    value = np.zeros((*points.shape[:-1], 3))
    for _ in range(24):
        wave = rng.normal(size=(3, 3)) * 14.0
        value += np.sin(points @ wave.T + rng.uniform(0, 6.28, 3))
    return np.clip(0.5 + value * 0.06, 0, 1)


def write_painted_room(folder: Path, frozen: bool = True) -> Path:
    """Four captures of the room, 160x120, and two ``frozen`` views."""
    mesh = room_mesh()
    instances = np.repeat([0, 1], 12)
    np.savez(folder / "room.npz", V=mesh.vertices, F=mesh.faces, I=instances, names=np.array(["room", "box"]))
    (folder / "depth").mkdir()
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    places = [(x, -1.2, 1.5, 0.3 * x) for x in (-0.9, -0.3, 0.3, 0.9)]
    places += [(-0.5, -0.9, 1.3, 0.0), (0.6, -0.8, 1.2, 0.4)] if frozen else []
    views = []
    for index, (x, y, z, aim) in enumerate(places):
        camera = LENS.at(look_at((x, y, z), (aim, 1.0, 0.5)))
        buffers = rasterizer.render(camera)
        file = folder / f"view{index}.png"
        save_image(file, paint(camera.unproject(buffers.depth)).astype(np.float32))
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        np.savez(folder / f"depth/view{index}.npz", z=buffers.depth, ids=ids)
        views.append(Capture(file.name, file, camera))
    save_cameras_json(folder / "cameras.json", views[:CAPTURES], frozen=views[CAPTURES:])
    return folder


def painted_photographs(folder: Path, mesh: trimesh.Trimesh, cameras, colour=paint) -> tuple[Capture, ...]:
    """Photographs of a mesh by ``cameras``, whose points (..., 3) have the ``colour`` of them."""
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    photographs = []
    for index, camera in enumerate(cameras):
        points = camera.unproject(rasterizer.render(camera).depth)
        file = folder / f"{index}.png"
        save_image(file, colour(points).astype(np.float32))
        photographs.append(Capture(file.name, file, camera))
    return tuple(photographs)
