"""The 3D view turned so that a room is looked into from where it was photographed."""

import math
from collections.abc import Iterable

import bpy
import numpy as np
from mathutils import Euler

_TILT_RAD = 0.85
"""From straight down: into the room over the walls' edge."""

_FARTHER = 1.15
"""Than the room's diagonal, so that what lies around the points is seen too."""

_OUTLIERS_PERCENT = 3.0
_STARTUP_CUBE_M = 2.0


def look_into(region_3d: bpy.types.RegionView3D, points: np.ndarray, cameras: Iterable) -> None:
    """Have a 3D view show the room of ``points`` (P, 3), in metres, in the cameras' mean direction."""
    poses = np.array([camera.matrix_world for camera in cameras]).reshape(-1, 4, 4)
    if not len(points) or not len(poses):
        return
    bounds = np.percentile(points, (_OUTLIERS_PERCENT, 100.0 - _OUTLIERS_PERCENT), axis=0)
    corners = np.concatenate([bounds, poses[:, :3, 3]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    region_3d.view_perspective = "PERSP"
    region_3d.view_rotation = Euler((_TILT_RAD, 0.0, heading_rad(poses[:, :3, 2]))).to_quaternion()
    region_3d.view_location = ((low + high) / 2.0).tolist()
    region_3d.view_distance = _FARTHER * float(np.linalg.norm(high - low))


def heading_rad(backwards: np.ndarray) -> float:
    """The turn about z of a view that looks where cameras look, whose z axes are ``backwards`` (N, 3)."""
    x, y, _ = -backwards.mean(axis=0)
    return math.atan2(-x, y)


def hide_startup_cube(scene: bpy.types.Scene) -> None:
    """Hide the cube of Blender's startup file, if it is as it came: the room is around it."""
    cube = scene.objects.get("Cube")
    if cube is None or cube.type != "MESH" or len(cube.data.vertices) != 8:
        return
    untouched = cube.matrix_world.is_identity and not (cube.modifiers or cube.animation_data or cube.children)
    if untouched and all(abs(side - _STARTUP_CUBE_M) < 1e-6 for side in cube.dimensions):
        cube.hide_set(True)
