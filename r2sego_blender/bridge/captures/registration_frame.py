"""The frame a person moves and turns to say where the world shall be: arrows with a grid."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError
from ...results.panels.bundle import Bundle
from ..shared.outliner import find_collection, fresh_collection, link
from .registration_marks import note_registration, registration_of, was_corrected_since

_PART = "Registration"
_ROLE = "r2sego_role"
_FRAME = "world frame"
_GRID_M, _STEP_M = 4.0, 1.0


def place_frame(scene: bpy.types.Scene, bundle: Bundle) -> bpy.types.Object:
    """Arrows at the world's origin with a grid of a metre's lines, in place of earlier ones."""
    collection = fresh_collection(scene, bundle.path, _PART)
    frame = bpy.data.objects.new("World Frame", None)
    frame.empty_display_type, frame.empty_display_size = "ARROWS", 1.0
    frame.show_name, frame.show_in_front = True, True
    frame[_ROLE] = _FRAME
    note_registration(frame, bundle)
    link(collection, frame)
    grid = bpy.data.objects.new("World Frame Grid", _grid_mesh())
    grid.parent = frame
    grid.display_type, grid.hide_select, grid.hide_render = "WIRE", True, True
    link(collection, grid)
    return frame


def find_frame(scene: bpy.types.Scene, bundle_path: str | Path) -> bpy.types.Object | None:
    """The arrows of ``place_frame``, None when they are gone."""
    collection = find_collection(scene, bundle_path, _PART)
    if collection is None:
        return None
    return next((one for one in collection.objects if one.get(_ROLE) == _FRAME), None)


def world_from_frame(scene: bpy.types.Scene, bundle: Bundle) -> np.ndarray:
    """(4, 4) float64: where the arrows stand now.

    Raises SceneError when there are none, or the world was corrected since they were placed.
    """
    frame = find_frame(scene, bundle.path)
    if frame is None:
        raise SceneError("there is no frame to take", cure="Place Frame, then move and turn its arrows.")
    if was_corrected_since(frame, registration_of(bundle)):  # Ctrl-Z brings back a frame that was taken
        raise SceneError(
            "the world was corrected since this frame was placed", cure="Place Frame, then move and turn its arrows."
        )
    return np.array(frame.matrix_world, np.float64)


def remove_frame(scene: bpy.types.Scene, bundle_path: str | Path) -> None:
    """Take the arrows and their grid away."""
    if find_frame(scene, bundle_path) is not None:
        fresh_collection(scene, bundle_path, _PART)


def _grid_mesh() -> bpy.types.Mesh:
    lines = np.arange(-_GRID_M, _GRID_M + 0.5 * _STEP_M, _STEP_M)
    ends = np.array([[-_GRID_M, _GRID_M]] * len(lines))
    along_x = np.stack([ends, np.repeat(lines[:, None], 2, 1), np.zeros_like(ends)], axis=2)
    vertices = np.concatenate([along_x, along_x[..., [1, 0, 2]]]).reshape(-1, 3)
    mesh = bpy.data.meshes.new("World Frame Grid")
    mesh.from_pydata(vertices.tolist(), np.arange(len(vertices)).reshape(-1, 2).tolist(), [])
    return mesh
