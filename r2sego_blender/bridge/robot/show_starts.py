"""Where a policy's episodes began, as small arrows on the floor in the colour of how each ended."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...results.panels.bundle import Bundle
from ..shared.materials import plain_material
from ..shared.meshes import add_attribute, assign_materials, mesh_from_arrays
from ..shared.outliner import fresh_collection, link

PART = "Policy starts"
EPISODE = "episode"
"""The attribute of a face: the number of the episode that began there."""

_SIDES = 16
_RADIUS_M, _LENGTH_M, _HALF_WIDTH_M = 0.05, 0.17, 0.04
_ABOVE_M = 0.01
# Okabe and Ito's, which colour-blind people tell apart: bluish green, then what stands out of it.
_SUCCESS = (0.0, 0.62, 0.45)
_FAILURES = (
    (0.84, 0.37, 0.0),
    (0.8, 0.47, 0.65),
    (0.9, 0.62, 0.0),
    (0.0, 0.45, 0.7),
    (0.94, 0.89, 0.26),
    (0.34, 0.71, 0.91),
)


def colours(ends: Sequence[str]) -> dict[str, tuple[float, float, float]]:
    """The sRGB colour of each way to end, '' for success; kinds of failure have theirs by their place."""
    failures = [end for end in ends if end]
    return {end: _FAILURES[failures.index(end) % len(_FAILURES)] if end else _SUCCESS for end in ends}


def show_starts(scene: bpy.types.Scene, bundle: Bundle, starts: np.ndarray, ended: Sequence[str]) -> bpy.types.Object:
    """A disc and an arrow for each of ``starts`` (N, 3), x and y in metres and the heading in radians, as one object.

    ``ended`` says how each episode ended, as ``colours`` knows it. It takes the place of what was shown before; those
    that never began, nan, are left out.
    """
    collection = fresh_collection(scene, bundle.path, PART)
    began = np.flatnonzero(np.isfinite(starts).all(axis=1))
    vertices, faces = _arrow()
    x, y, heading = starts[began].T
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    turned = np.stack([cos * vertices[:, 0] - sin * vertices[:, 1], sin * vertices[:, 0] + cos * vertices[:, 1]], -1)
    placed = np.full((len(began), len(vertices), 3), _ABOVE_M)
    placed[..., :2] = turned + np.stack([x, y], axis=1)[:, None]
    indices = faces + len(vertices) * np.arange(len(began))[:, None, None]
    mesh = mesh_from_arrays("Start poses", placed.reshape(-1, 3).astype(np.float32), indices.reshape(-1, 3))
    of_ends = colours(sorted(set(ended)))
    slots = np.array([list(of_ends).index(ended[number]) for number in began], np.int32)
    materials = [plain_material(f"R2S-EGO start, {end or 'success'}", colour) for end, colour in of_ends.items()]
    assign_materials(mesh, materials, np.repeat(slots, len(faces)))
    add_attribute(mesh, EPISODE, np.repeat(began, len(faces)))
    shown = bpy.data.objects.new("Start poses", mesh)
    shown.show_in_front = True
    shown.lock_location = shown.lock_rotation = shown.lock_scale = (True, True, True)
    link(collection, shown)
    return shown


def _arrow() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 2) in metres and faces (F, 3) of a disc at the origin with a tip ahead along +x."""
    turns = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    rim = _RADIUS_M * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    tip = [[0.0, -_HALF_WIDTH_M], [_LENGTH_M, 0.0], [0.0, _HALF_WIDTH_M]]
    fan = [(0, side + 1, (side + 1) % _SIDES + 1) for side in range(_SIDES)]
    faces = np.array([*fan, (_SIDES + 1, _SIDES + 2, _SIDES + 3)], np.int32)
    return np.concatenate([np.zeros((1, 2)), rim, tip]), faces
