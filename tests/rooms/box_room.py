"""A textured box room with boxes in it, rendered exactly by ray casting in numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance

ROOM = (np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 2.5]))
TABLE = (np.array([-0.4, 0.2, 0.0]), np.array([0.4, 0.8, 0.7]))

_QUADS = np.array(  # of the corners numbered x + 2 y + 4 z, counter-clockwise from outside
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)


def lens(width: int = 160, height: int = 120) -> Camera:
    return Camera(width, height, 0.6 * width, 0.6 * width, width / 2, height / 2, np.eye(4))


def arc(count: int, width: int = 160, height: int = 120) -> list[Camera]:
    """Cameras on an arc at the room's -y side, looking across the table."""
    angles = np.linspace(-0.6, 0.6, count)
    centres = np.stack([1.7 * np.sin(angles), -1.7 * np.cos(angles), np.full(count, 1.4)], axis=1)
    return [lens(width, height).at(look_at(centre, [0.0, 0.5, 0.6])) for centre in centres]


def texture(points: np.ndarray) -> np.ndarray:
    """(..., 3) colours in [0.1, 0.9], smooth at the scale of a pixel and never repeating."""
    x, y, z = np.moveaxis(points, -1, 0)
    waves = [
        np.sin(9 * x + 5 * y + 3 * np.sin(4 * z)),
        np.sin(7 * y - 6 * z + 2 * np.sin(5 * x)),
        np.sin(8 * z + 4 * x - 3 * np.sin(6 * y)),
    ]
    return 0.5 + 0.4 * np.stack(waves, axis=-1)


def render(camera: Camera, boxes=(TABLE,), colour=texture) -> tuple[np.ndarray, np.ndarray]:
    """The exact image (H, W, 3) float32 and planar depth (H, W) float32."""
    rays = camera.rays() @ camera.world_from_camera[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = _slab(camera.centre, rays, *ROOM)
        depth = far
        for box in boxes:
            near, far = _slab(camera.centre, rays, *box)
            depth = np.where((near <= far) & (near > 0.0), np.minimum(depth, near), depth)
    points = camera.centre + rays * depth[..., None]
    return colour(points).astype(np.float32), depth.astype(np.float32)


def _slab(origin, rays, low, high):
    a, b = (low - origin) / rays, (high - origin) / rays
    return np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)


def proxy(boxes=(TABLE,)) -> GeometryProxy:
    """The same room as a mesh, its faces counter-clockwise from the free side."""
    vertices, faces = [], []
    for index, (low, high) in enumerate([ROOM, *boxes]):
        corners = np.array([[(low, high)[i >> a & 1][a] for a in range(3)] for i in range(8)])
        triangles = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])
        faces.append((triangles[:, ::-1] if index == 0 else triangles) + 8 * index)
        vertices.append(corners)
    joined = np.concatenate(faces).astype(np.int32)
    count = len(joined)
    provenance = np.full(count, Provenance.OBSERVED, np.uint8)
    provenance[:12] = Provenance.COMPLETED  # the room's walls
    return GeometryProxy(
        np.concatenate(vertices).astype(np.float32),
        joined,
        provenance,
        np.full(count, 3, np.uint16),
        np.ones(count, np.float32),
    )


def write_captures(folder: Path, cameras, boxes=(TABLE,), colour=texture, gains=None):
    """The cameras' photographs on disk; returns captures and their exact depths."""
    captures, depths = [], []
    for index, camera in enumerate(cameras):
        image, depth = render(camera, boxes, colour)
        path = folder / f"photo{index}.png"
        save_image(path, image * (1.0 if gains is None else gains[index]))
        captures.append(Capture(path.stem, path, camera))
        depths.append(depth)
    return captures, depths


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(10.0 * np.log10(1.0 / np.mean((a - b) ** 2)))
