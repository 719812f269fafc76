"""Edits of the proxy made in Blender: which faces are meant, and what the engine is given."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core.arrays import save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...splats.regions import Lasso
from ..shared.meshes import arrays_from_mesh
from ..shared.simplified_viewport import every_face
from .show_proxy import shown_round


def face_corners(mesh: bpy.types.Mesh) -> np.ndarray:
    """(F, 3, 3) float32 corners of the faces of a mesh of triangles, in its order and frame."""
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    if len(corners) != 3 * len(mesh.polygons):
        raise GeometryError(
            "the proxy's faces are no triangles any more", where=mesh.name, cure="Show the proxy again."
        )
    return vertices.reshape(-1, 3)[corners.reshape(-1, 3)]


def world_corners(shown: bpy.types.Object) -> np.ndarray:
    """(F, 3, 3) float64 corners of the faces of a shown proxy where it stands, in the world."""
    world = np.array(shown.matrix_world, np.float64)
    corners = face_corners(shown.data) @ world[:3, :3].T + world[:3, 3]
    return corners if np.linalg.det(world[:3, :3]) > 0.0 else corners[:, ::-1]  # mirrored: as it is drawn


def selected_faces(shown: bpy.types.Object) -> np.ndarray:
    """(F,) bool: the selected faces of a shown proxy, in Edit Mode too."""
    if shown.mode == "EDIT":
        shown.update_from_editmode()
    chosen = np.empty(len(shown.data.polygons), bool)
    shown.data.polygons.foreach_get("select", chosen)
    return chosen


def select_faces(shown: bpy.types.Object, chosen: np.ndarray, *, extend: bool = False) -> int:
    """Select the faces ``chosen`` (F,) bool of a shown proxy, beside those selected before if asked.

    In Object Mode. Returns how many are selected then.
    """
    mesh = shown.data
    if extend:
        chosen = chosen | selected_faces(shown)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    touched = np.zeros(len(mesh.vertices), bool)
    touched[corners.reshape(-1, 3)[chosen].ravel()] = True
    mesh.vertices.foreach_set("select", touched)
    mesh.edges.foreach_set("select", np.zeros(len(mesh.edges), bool))
    mesh.polygons.foreach_set("select", chosen)
    mesh.update()
    return int(chosen.sum())


def faces_in_lasso(
    corners: np.ndarray,
    camera: Camera,
    polygon: np.ndarray,
    *,
    parallel: bool,
    farthest_m: float,
    facing: bool = True,
    kept_sides: np.ndarray | None = None,
) -> np.ndarray:
    """(F,) bool: the faces (F, 3, 3) whose middle lies inside a ``polygon`` (n, 2) of a view's pixels.

    ``camera`` and ``parallel`` are as ``view_camera`` gives them. Faces farther than ``farthest_m``
    are left out, those seen from behind if ``facing``, and those not on the positive side of the
    planes ``kept_sides`` (K, 4), such as the view's Clipping Region.
    """
    corners = np.asarray(corners, np.float64)
    middles = corners.mean(1)
    nearest_m = -farthest_m if parallel else 0.0
    sides = np.zeros((0, 4)) if kept_sides is None else kept_sides
    inside = Lasso(camera, polygon, nearest_m, farthest_m, parallel, sides).holds(middles)
    if facing:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        ray = camera.forward if parallel else middles - camera.centre
        inside &= (normals * ray).sum(1) < 0.0
    return inside


def write_cut(file: Path, shown: bpy.types.Object) -> int:
    """Write the selected faces of a shown proxy as ``r2sego edit-proxy --cut`` reads them; how many.

    Raises GeometryError when none is selected.
    """
    chosen = selected_faces(shown)
    if not chosen.any():
        raise GeometryError(
            "no face of the proxy is selected",
            where=shown.name,
            cure="Select faces in Edit Mode, or with the lasso or a box.",
        )
    corners = face_corners(shown.data)[chosen]
    save_arrays(file, corners=corners, round=np.int64(shown_round(shown)))
    return int(chosen.sum())


def write_drawn(file: Path, drawn: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> int:
    """Write a mesh object, its modifiers applied, as ``r2sego edit-proxy --draw`` reads it; its triangles.

    Raises GeometryError when it has no faces.
    """
    vertices, triangles = world_triangles(drawn, depsgraph)
    if not len(triangles):
        raise GeometryError("the drawn surface has no faces", where=drawn.name, cure="Draw a mesh with faces.")
    save_arrays(file, vertices=vertices, faces=triangles)
    return len(triangles)


def world_triangles(one: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 in the world and triangles (F, 3) int32 of an object, modifiers applied.

    Raises SceneError for one that Blender does not evaluate.
    """
    if one.mode == "EDIT":
        one.update_from_editmode()
    with every_face(one, depsgraph) as evaluated:
        mesh = evaluated.to_mesh()
        try:
            vertices, triangles = arrays_from_mesh(mesh)
        finally:
            evaluated.to_mesh_clear()
        world = np.array(evaluated.matrix_world, np.float64)
    if np.linalg.det(world[:3, :3]) < 0.0:
        triangles = triangles[:, ::-1]  # mirrored: the free side stays outside
    return vertices.astype(np.float64) @ world[:3, :3].T + world[:3, 3], np.ascontiguousarray(triangles)
