"""Rigid bodies as a camera sees them: posed, drawn by the mesh rasteriser, shaded by one light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.cameras import Camera
from ..geometry.visibility.rasterizer import MeshRasterizer
from ..robot.rollouts.bodies import BodyShape

# Light from all sides, and what the light adds to a face that is turned to it.
_AMBIENT, _DIFFUSE = 0.55, 0.45


@dataclass(frozen=True)
class DrawnBody:
    """A body's triangles in its own frame, and what drawing them asks of each.

    ``vertices`` (V, 3) and ``normals`` (F, 3) float64, outward unit vectors, 0 where a triangle is
    none; ``offsets`` (F,) are the normals' products with a corner; ``faces`` (F, 3), ``colours`` (F, 3)
    sRGB in [0, 1]; the sphere of ``centre`` (3,) and ``radius_m`` holds them all.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colours: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray
    centre: np.ndarray
    radius_m: float

    @staticmethod
    def of(shape: BodyShape) -> DrawnBody:
        vertices = shape.vertices.astype(np.float64)
        first, second, third = (vertices[shape.faces[:, corner]] for corner in range(3))
        normals = np.cross(second - first, third - first)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
        radius_m = float(np.linalg.norm(vertices - centre, axis=1).max())
        offsets = np.einsum("fi,fi->f", normals, first)
        return DrawnBody(vertices, shape.faces, shape.colours, normals, offsets, centre, radius_m)


def draw_bodies(
    bodies: Sequence[tuple[DrawnBody, np.ndarray]], camera: Camera, light: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Depth (H, W) float32 metres, 0 for none, and colour (H, W, 3) float32 sRGB; None where none is in view.

    ``bodies`` have their poses ``world_from_body`` (4, 4); ``light`` (3,) is the unit vector to it in the
    world. Faces turned away are not drawn, as MuJoCo draws them: a camera inside a head looks out of it.
    """
    in_view = _in_view(bodies, camera)
    vertices, faces, normals, colours = [], [], [], []
    count = 0
    for body, pose in (bodies[index] for index in in_view):
        turn, place = pose[:3, :3], pose[:3, 3]
        front = body.normals @ (turn.T @ (camera.centre - place)) > body.offsets
        vertices.append(body.vertices @ turn.T + place)
        faces.append(body.faces[front] + count)
        normals.append(body.normals[front] @ (turn.T @ light))
        colours.append(body.colours[front])
        count += len(body.vertices)
    if not count:
        return None
    buffers = MeshRasterizer(np.concatenate(vertices), np.concatenate(faces)).render(camera)
    if not buffers.depth.any():
        return None
    shades = _AMBIENT + _DIFFUSE * np.maximum(np.concatenate(normals), 0.0)
    shown = np.concatenate(colours) * shades[:, None]
    return buffers.depth, buffers.of_face(shown.astype(np.float32))


def _in_view(bodies: Sequence[tuple[DrawnBody, np.ndarray]], camera: Camera) -> np.ndarray:
    """Indices of those whose spheres reach into what the camera sees."""
    if not bodies:
        return np.empty(0, int)
    poses = np.array([pose for _, pose in bodies])
    centres = np.einsum("bij,bj->bi", poses[:, :3, :3], [body.centre for body, _ in bodies]) + poses[:, :3, 3]
    local = centres @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
    radius_m = np.array([body.radius_m for body, _ in bodies])
    sides = np.array(
        [
            (camera.fx, 0.0, camera.cx),
            (-camera.fx, 0.0, camera.width - camera.cx),
            (0.0, camera.fy, camera.cy),
            (0.0, -camera.fy, camera.height - camera.cy),
            (0.0, 0.0, 1.0),
        ]
    )
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    return np.flatnonzero((local @ sides.T > -radius_m[:, None]).all(axis=1))
