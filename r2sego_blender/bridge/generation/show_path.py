"""A generated clip in the scene: its camera's way as a curve, the camera that goes along it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ...core.cameras import Camera
from ..shared import preview_range
from ..shared.cameras import create_camera, object_pose
from ..shared.materials import plain_material
from ..shared.outliner import fresh_collection, link

_PART = "Camera path"
_COLOUR = (0.98, 0.90, 0.25)
_WIDTH_M = 0.004


def show_path(
    scene: bpy.types.Scene, bundle_path: str | Path, name: str, path: Sequence[Camera], first_frame: int = 1
) -> tuple[bpy.types.Object, bpy.types.Object]:
    """The way as a curve and a camera at ``path[i]`` in frame ``first_frame + i``.

    They stand in place of those shown before; the timeline's preview range becomes the
    clip's, until something else is looked at. Returns the curve and the camera.
    """
    collection = fresh_collection(scene, bundle_path, _PART)
    curve = _curve(f"{name} path", np.array([camera.centre for camera in path]))
    camera = create_camera(f"{name} clip", path[-1])
    for made in (curve, camera):
        link(collection, made)
    _animate(camera, path, first_frame)
    preview_range.lend(scene, first_frame, first_frame + len(path) - 1)
    return curve, camera


def _curve(name: str, places: np.ndarray) -> bpy.types.Object:
    data = bpy.data.curves.new(name, "CURVE")
    data.dimensions = "3D"
    data.bevel_depth = _WIDTH_M
    spline = data.splines.new("POLY")
    spline.points.add(len(places) - 1)
    spline.points.foreach_set("co", np.pad(places, ((0, 0), (0, 1)), constant_values=1.0).ravel())
    data.materials.append(plain_material("R2S-EGO camera path", _COLOUR))
    created = bpy.data.objects.new(name, data)
    created.hide_select = True
    return created


def _animate(camera: bpy.types.Object, path: Sequence[Camera], first_frame: int) -> None:
    """A key in every frame, so that nothing is interpolated."""
    camera.rotation_mode = "QUATERNION"
    before = None
    for offset, stand in enumerate(path):
        place, turn, _ = Matrix(object_pose(stand.world_from_camera).tolist()).decompose()
        if before is not None:
            turn.make_compatible(before)
        before = turn
        camera.location, camera.rotation_quaternion = place, turn
        for channel in ("location", "rotation_quaternion"):
            camera.keyframe_insert(channel, frame=first_frame + offset)
