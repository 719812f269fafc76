"""Furniture made of boxes in a made-up room, as masks, depth and observed points show it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.planes import RoomPlanes
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

ROOM_LOW, ROOM_HIGH = np.array([-2.5, -2.0, 0.0]), np.array([2.5, 2.0, 2.5])

Mesh = tuple[np.ndarray, np.ndarray]


def boxes(*parts: tuple[Sequence[float], Sequence[float]]) -> Mesh:
    """Vertices (V, 3) and faces (F, 3) of boxes, each given by its lowest and highest corner."""
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=part) for part in parts])
    return np.array(mesh.vertices), np.array(mesh.faces)


def _legs(x: float, y: float, height: float, thick: float = 0.05) -> list:
    return [
        ((sx * x - thick / 2, sy * y - thick / 2, 0.0), (sx * x + thick / 2, sy * y + thick / 2, height))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]


FURNITURE: dict[str, Callable[[], Mesh]] = {
    "chair": lambda: boxes(  # its back and its one arm tell every side from the others
        ((-0.23, -0.23, 0.43), (0.23, 0.23, 0.48)),
        ((-0.23, 0.19, 0.48), (0.23, 0.23, 0.95)),
        ((-0.23, -0.18, 0.66), (-0.19, 0.19, 0.70)),
        *_legs(0.2, 0.2, 0.43),
    ),
    "table": lambda: boxes(((-0.6, -0.4, 0.7), (0.6, 0.4, 0.75)), *_legs(0.55, 0.35, 0.7)),
    "stool": lambda: boxes(((-0.2, -0.2, 0.6), (0.2, 0.2, 0.64)), *_legs(0.17, 0.17, 0.6, 0.04)),
    "cupboard": lambda: boxes(((-0.4, -0.2, 0.1), (0.4, 0.2, 1.1)), *_legs(0.35, 0.15, 0.1)),
    "lamp": lambda: boxes(
        ((-0.15, -0.15, 0.0), (0.15, 0.15, 0.03)),
        ((-0.015, -0.015, 0.03), (0.015, 0.015, 1.4)),
        ((-0.18, -0.18, 1.15), (0.18, 0.18, 1.45)),
    ),
}


def moved(vertices: np.ndarray, similarity: np.ndarray) -> np.ndarray:
    """Points (V, 3) after a (4, 4) similarity."""
    return vertices @ similarity[:3, :3].T + similarity[:3, 3]


def standing(heading_deg: float, place: Sequence[float], scale: float = 1.0) -> np.ndarray:
    """(4, 4): an upright pose on the floor at ``place`` (2,)."""
    pose = np.eye(4)
    pose[:3, :3] = scale * Rotation.from_euler("z", heading_deg, degrees=True).as_matrix()
    pose[:2, 3] = place
    return pose


def random_similarity(rng: np.random.Generator, scales: tuple[float, float] = (0.3, 3.0)) -> np.ndarray:
    """(4, 4): any rotation, a scale between ``scales`` and a shift."""
    similarity = np.eye(4)
    turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    similarity[:3, :3] = np.exp(rng.uniform(*np.log(scales))) * turn
    similarity[:3, 3] = rng.normal(size=3)
    return similarity


def room_bounds() -> RoomPlanes:
    """Floor, ceiling and walls."""
    normals = np.concatenate([np.eye(3), -np.eye(3)])[[2, 0, 1, 3, 4, 5]]
    offsets = np.concatenate([ROOM_LOW, -ROOM_HIGH])[[2, 0, 1, 3, 4, 5]]
    return RoomPlanes(normals, offsets, np.full(6, 1000), np.ones(6, bool))


def cameras_around(target: Sequence[float], count: int = 5, width: int = 320) -> list[Camera]:
    """Cameras 1.7 m from ``target`` on more than half a circle, at the height of eyes."""
    cameras = []
    for angle in np.linspace(-1.9, 1.9, count):
        centre = (target[0] + 1.7 * np.sin(angle), target[1] - 1.7 * np.cos(angle), 1.45)
        height, focal_px = width * 3 // 4, 0.9 * width
        pose = look_at(centre, target)
        cameras.append(Camera(width, height, focal_px, focal_px, width / 2, height / 2, pose))
    return cameras


def in_the_room(vertices: np.ndarray, faces: np.ndarray) -> MeshRasterizer:
    """A mesh, its faces first, and the room around it."""
    shell = trimesh.creation.box(bounds=(ROOM_LOW, ROOM_HIGH))
    return MeshRasterizer(
        np.concatenate([vertices, shell.vertices]), np.concatenate([faces, shell.faces + len(vertices)])
    )


def observed_object(
    vertices: np.ndarray,
    faces: np.ndarray,
    cameras: Sequence[Camera],
    rng: np.random.Generator,
    noise_m: float = 0.004,
    count: int = 900,
) -> SimpleNamespace:
    """What ``cameras`` see of a mesh (world metres) in the room.

    ``masks`` (H, W) bool, ``depths`` (H, W) float32 of everything, ``points`` (P, 3) on the
    object with noise along the rays.
    """
    room = in_the_room(vertices, faces)
    masks, depths, points = [], [], []
    for camera in cameras:
        buffers = room.render(camera)
        mask = (buffers.face >= 0) & (buffers.face < len(faces))
        noisy = buffers.depth + rng.normal(size=mask.shape) * noise_m
        masks.append(mask)
        depths.append(buffers.depth)
        points.append(camera.unproject(noisy)[mask])
    points = np.concatenate(points)
    return SimpleNamespace(
        cameras=list(cameras),
        masks=masks,
        depths=depths,
        points=points[rng.permutation(len(points))[:count]],
        bounds=room_bounds(),
    )


def wider(mask: np.ndarray) -> np.ndarray:
    """A mask drawn a pixel too far out."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


def narrower(mask: np.ndarray) -> np.ndarray:
    """A mask drawn a pixel too far in."""
    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
