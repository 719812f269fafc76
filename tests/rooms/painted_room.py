"""A small rendered scene with its truth, as the benchmarks take them."""

from pathlib import Path

import numpy as np
import trimesh
from cameras_file import save_cameras_json

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

CAPTURES = 4


def paint(points: np.ndarray) -> np.ndarray:
    """A smooth colour that never repeats, for points (..., 3)."""
    waves = np.random.default_rng(11).normal(size=(24, 3, 3)) * 14.0
    value = sum(np.sin(points @ wave.T + phase) for phase, wave in enumerate(waves))
    return np.clip(0.5 + 0.06 * value, 0, 1).astype(np.float32)


def write_painted_room(folder: Path, frozen: bool = True) -> Path:
    """A painted room of 4 m by 3 m with a box in it: four captures of 160x120, and two ``frozen`` views."""
    shell = trimesh.creation.box((4.0, 3.0, 2.4))
    shell.apply_translation((0, 0, 1.2))
    shell.invert()
    box = trimesh.creation.box((1.0, 0.6, 0.7))
    box.apply_translation((0.9, 0.8, 0.35))
    mesh = trimesh.util.concatenate([shell, box])
    instances = np.repeat([0, 1], [len(shell.faces), len(box.faces)])
    np.savez(folder / "room.npz", V=mesh.vertices, F=mesh.faces, I=instances, names=np.array(["room", "box"]))
    (folder / "depth").mkdir()
    rasterizer = MeshRasterizer(mesh.vertices, mesh.faces)
    places = [(x, -1.2, 1.5, 0.3 * x) for x in (-0.9, -0.3, 0.3, 0.9)]
    places += [(-0.5, -0.9, 1.3, 0.0), (0.6, -0.8, 1.2, 0.4)] if frozen else []
    views = []
    for index, (x, y, z, aim) in enumerate(places):
        camera = Camera(160, 120, 105.0, 105.0, 80.0, 60.0, look_at((x, y, z), (aim, 1.0, 0.5)))
        buffers = rasterizer.render(camera)
        file = folder / f"view{index}.png"
        save_image(file, paint(camera.unproject(buffers.depth)))
        ids = buffers.of_face(instances, missing=-1).astype(np.int16)
        np.savez(folder / f"depth/view{index}.npz", z=buffers.depth, ids=ids)
        views.append(Capture(file.name, file, camera))
    save_cameras_json(folder / "cameras.json", views[:CAPTURES], frozen=views[CAPTURES:])
    return folder
