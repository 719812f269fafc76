"""Building blocks: pieces of furniture made of boxes, turned profiles, cushions and panels.

All lengths are metres. A ``Piece`` is an empty at the piece's place on the floor; its parts
are children in the piece's own frame (x along its width, -y towards its front, z up), so an
artist can move or turn the whole piece by its empty.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, pi, radians, sin

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

Vector3 = tuple[float, float, float]
UPRIGHT: Vector3 = (0.0, 0.0, 0.0)
ON_WALL: Vector3 = (90.0, 0.0, 0.0)
"""The tilt that turns a panel's face from +z to the piece's front, -y."""


class Piece:
    """One movable thing of the room."""

    def __init__(self, name: str, at: Sequence[float] = (0.0, 0.0, 0.0), turn_deg: float = 0.0) -> None:
        self.name = name
        self.frame = bpy.data.objects.new(name, None)
        self.frame.empty_display_size = 0.2
        self.frame.location = (at[0], at[1], at[2] if len(at) > 2 else 0.0)
        self.frame.rotation_euler = (0.0, 0.0, radians(turn_deg))
        bpy.context.scene.collection.objects.link(self.frame)

    def add(
        self, mesh: bpy.types.Mesh, centre: Sequence[float], material: bpy.types.Material, tilt_deg: Vector3 = UPRIGHT
    ) -> bpy.types.Object:
        """Place a mesh at ``centre`` in this piece's frame, turned by XYZ Euler angles."""
        part = bpy.data.objects.new(f"{self.name}.{mesh.name}", mesh)
        if not mesh.materials:
            mesh.materials.append(material)
        part.parent = self.frame
        tilt = Euler([radians(angle) for angle in tilt_deg]).to_matrix().to_4x4()
        part.matrix_local = Matrix.Translation(Vector(centre)) @ tilt
        bpy.context.scene.collection.objects.link(part)
        return part

    def box(
        self,
        centre: Sequence[float],
        size: Sequence[float],
        material: bpy.types.Material,
        bevel: float = 0.006,
        tilt_deg: Vector3 = UPRIGHT,
    ) -> bpy.types.Object:
        """A box of full ``size`` with rounded edges."""
        corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
        sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        mesh = new_mesh("box", np.array(corners) * size, sides)
        part = self.add(mesh, centre, material, tilt_deg)
        if bevel:
            rounding = part.modifiers.new("rounding", "BEVEL")
            rounding.width = bevel
            rounding.segments = 3
        return part

    def beam(
        self, start: Sequence[float], end: Sequence[float], radii: tuple[float, float], material: bpy.types.Material
    ) -> bpy.types.Object:
        """A round bar from ``start`` to ``end``, tapering from the first to the second radius."""
        start, end = Vector(start), Vector(end)
        length = (end - start).length
        mesh = turned_mesh([(0.0, 0.0), (radii[0], 0.0), (radii[1], length), (0.0, length)], sides=20)
        part = self.add(mesh, start, material)
        part.matrix_local = Matrix.Translation(start) @ (end - start).to_track_quat("Z", "Y").to_matrix().to_4x4()
        return part

    def turned(
        self,
        centre: Sequence[float],
        profile: Sequence[tuple[float, float]],
        material: bpy.types.Material,
        sides: int = 40,
    ) -> bpy.types.Object:
        """A body of revolution of the (radius, height) ``profile``, as on a lathe."""
        return self.add(turned_mesh(profile, sides), centre, material)

    def cushion(
        self,
        centre: Sequence[float],
        size: Sequence[float],
        material: bpy.types.Material,
        radius: float = 0.05,
        crown: float = 0.02,
        tilt_deg: Vector3 = UPRIGHT,
    ) -> bpy.types.Object:
        """An upholstered block: a rounded box whose broad sides swell by ``crown``."""
        return self.add(cushion_mesh(np.array(size), radius, crown), centre, material, tilt_deg)

    def pillow(
        self, centre: Sequence[float], size: Sequence[float], material: bpy.types.Material, tilt_deg: Vector3 = UPRIGHT
    ) -> bpy.types.Object:
        """A throw pillow: two swelling squares sewn together at the rim, broad side up."""
        return self.add(pillow_mesh(*size), centre, material, tilt_deg)

    def panel(
        self,
        centre: Sequence[float],
        size: tuple[float, float],
        material: bpy.types.Material,
        tilt_deg: Vector3 = UPRIGHT,
    ) -> bpy.types.Object:
        """A flat rectangle facing +z whose picture fills it (UV from corner to corner)."""
        half_x, half_y = size[0] / 2, size[1] / 2
        corners = [(-half_x, -half_y, 0), (half_x, -half_y, 0), (half_x, half_y, 0), (-half_x, half_y, 0)]
        mesh = new_mesh("panel", corners, [(0, 1, 2, 3)])
        uv = mesh.uv_layers.new(name="UVMap")
        uv.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        return self.add(mesh, centre, material, tilt_deg)


def new_mesh(name: str, vertices, faces, smooth: bool = False) -> bpy.types.Mesh:
    """A mesh of (V, 3) vertices and a list of polygons."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, vertex)) for vertex in vertices], [], faces)
    if smooth:
        mesh.shade_smooth()
    return mesh


def grid_mesh(name: str, points: np.ndarray, smooth: bool = True) -> bpy.types.Mesh:
    """A mesh of an (R, C, 3) grid of points, with UV over the grid."""
    rows, columns, _ = points.shape
    mesh = new_mesh(name, points.reshape(-1, 3), _grid_faces(rows, columns), smooth)
    v, u = np.mgrid[0 : 1 : rows * 1j, 0 : 1 : columns * 1j]
    per_vertex = np.stack([u, v], axis=-1).reshape(-1, 2)
    loops = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", loops)
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", per_vertex[loops].ravel())
    return mesh


def turned_mesh(profile: Sequence[tuple[float, float]], sides: int = 40) -> bpy.types.Mesh:
    """A body of revolution around z of a (radius, height) profile, edges sharp above 40 degrees."""
    angles = [2 * pi * step / sides for step in range(sides)]
    vertices = [(radius * cos(a), radius * sin(a), height) for radius, height in profile for a in angles]
    faces = []
    for ring in range(len(profile) - 1):
        for step in range(sides):
            following = (step + 1) % sides
            low, high = ring * sides, (ring + 1) * sides
            faces.append((low + step, low + following, high + following, high + step))
    mesh = new_mesh("turned", vertices, faces, smooth=True)
    mesh.set_sharp_from_angle(angle=radians(40))
    return mesh


def cushion_mesh(size: np.ndarray, radius: float, crown: float, cells: int = 12) -> bpy.types.Mesh:
    """A rounded box of full ``size``; every side swells towards its middle."""
    half = size / 2
    radius = min(radius, float(half.min()) * 0.98)
    vertices, faces = _subdivided_cube(cells)
    cube = np.sin(vertices * pi / 2)  # denser towards the edges, where the rounding is
    core = np.clip(cube * half, -(half - radius), half - radius)
    outward = cube * half - core
    length = np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    rounded = core + outward / length * radius
    relative = rounded / half
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        swell = np.prod(1 - np.clip(relative[:, across], -1, 1) ** 2, axis=1)
        rounded[:, axis] += crown * swell * relative[:, axis]
    return new_mesh("cushion", rounded, faces, smooth=True)


def pillow_mesh(width: float, depth: float, thickness: float, cells: int = 16) -> bpy.types.Mesh:
    """A pillow around the xy-plane; its sides draw in between the pointed corners."""
    y, x = np.mgrid[-1 : 1 : (cells + 1) * 1j, -1 : 1 : (cells + 1) * 1j]
    height = np.sqrt(np.clip((1 - np.abs(x) ** 2.6) * (1 - np.abs(y) ** 2.6), 0, None)) * thickness / 2
    drawn_x = x * (1 - 0.07 * (1 - y**2))
    drawn_y = y * (1 - 0.07 * (1 - x**2))
    top = np.stack([drawn_x * width / 2, drawn_y * depth / 2, height], axis=-1).reshape(-1, 3)
    below = top * (1, 1, -1)
    faces = _grid_faces(cells + 1, cells + 1)
    turned_over = [tuple(index + len(top) for index in reversed(face)) for face in faces]
    return new_mesh("pillow", np.concatenate([top, below]), faces + turned_over, smooth=True)


def _grid_faces(rows: int, columns: int) -> list[tuple[int, int, int, int]]:
    corner = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1)
    return [tuple(quad) for quad in quads.reshape(-1, 4).tolist()]


def _subdivided_cube(cells: int) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Vertices in [-1, 1]^3 and outward quads of a cube of ``cells`` x ``cells`` a side."""
    v, u = np.mgrid[-1 : 1 : (cells + 1) * 1j, -1 : 1 : (cells + 1) * 1j]
    ones = np.ones_like(u)
    sides = [(u, v, ones), (-u, v, -ones), (ones, u, v), (-ones, -u, v), (-u, ones, v), (u, -ones, v)]
    points = np.concatenate([np.stack(side, axis=-1).reshape(-1, 3) for side in sides])
    welded, index = np.unique(points.round(6), axis=0, return_inverse=True)
    index = index.reshape(-1)
    per_side = (cells + 1) ** 2
    faces = []
    for side in range(6):
        for face in _grid_faces(cells + 1, cells + 1):
            faces.append(tuple(int(index[side * per_side + corner]) for corner in face))
    return welded, faces
