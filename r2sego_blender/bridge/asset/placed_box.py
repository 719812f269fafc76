"""The box that a person placed around something, as a region of space."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.errors import SceneError
from ...splats.regions import Box

_FLATTEST_M3 = 1e-12


def placed_box(placed: bpy.types.Object) -> Box:
    """The box of an empty, as its cube is drawn, or of an object's bounds, in the world.

    Raises SceneError for one without a volume.
    """
    if placed.mode == "EDIT":
        placed.update_from_editmode()  # its bounds are those of before until then
    pose = np.array(placed.matrix_world, np.float64)
    low, high = np.array(placed.bound_box).min(axis=0), np.array(placed.bound_box).max(axis=0)
    if placed.type == "EMPTY":
        low, high = np.full(3, -placed.empty_display_size), np.full(3, placed.empty_display_size)
    middle = np.eye(4)
    middle[:3, 3] = (low + high) / 2.0
    if abs(np.linalg.det(pose[:3, :3])) * np.prod(high - low) < _FLATTEST_M3:
        raise SceneError("the object has no volume", where=placed.name, cure="Choose an empty or a solid object.")
    return Box(pose @ middle, (high - low) / 2.0)
