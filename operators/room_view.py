"""A bundle's room as it is first seen: looked into from where it was photographed, with its newest splats."""

import math

import bpy
import numpy as np
from mathutils import Euler

from ..r2sego_blender.bridge.shared.views_3d import views_3d
from ..r2sego_blender.core.errors import R2SEgoError
from ..r2sego_blender.results.panels.bundle import Bundle
from .asset.show_asset import show_stage
from .base import told

_TILT_RAD = 0.85
"""From straight down: into the room over the walls' edge."""

_FARTHER = 1.15
"""Than the room's diagonal, so that what lies around the points is seen too."""

_OUTLIERS_PERCENT = 3.0
_STARTUP_CUBE_M = 2.0


def show_room(scene: bpy.types.Scene, bundle: Bundle) -> str:
    """Look into the room of the bundle that a Blender scene has just opened, and show its newest asset.

    Without an asset its points are drawn. Returns what could not be shown, in a clause, or ''.
    """
    try:
        look_into_room(scene, bundle)
        stages = scene.r2sego_asset.stages
        if len(stages) and scene.r2sego_asset.shown is None:  # of a bundle that only moved it is shown already
            show_stage(scene, stages[len(stages) - 1].name)
        scene.r2sego_captures.show_cloud = not len(stages)  # which would lie over the splats
    except (R2SEgoError, OSError) as error:
        return f", but showing it failed: {told(error)}"
    return ""


def look_into_room(scene: bpy.types.Scene, bundle: Bundle) -> None:
    """Turn every 3D view of a Blender scene into the bundle's room, and hide the startup cube, which is around one.

    Raises R2SEgoError when the captures are damaged.
    """
    hide_startup_cube(scene)
    points = bundle.sparse_points()[0]
    poses = np.array([view.camera.world_from_camera for view in bundle.captures()])
    for area in views_3d(scene):
        look_into(area.spaces.active.region_3d, points, poses)


def look_into(region_3d: bpy.types.RegionView3D, points: np.ndarray, world_from_camera: np.ndarray) -> None:
    """Have a 3D view show the room of ``points`` (P, 3), in metres, in the cameras' mean direction.

    ``world_from_camera`` (N, 4, 4) has OpenCV axes.
    """
    if not len(points) or not len(world_from_camera):
        return
    bounds = np.percentile(points, (_OUTLIERS_PERCENT, 100.0 - _OUTLIERS_PERCENT), axis=0)
    corners = np.concatenate([bounds, world_from_camera[:, :3, 3]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    region_3d.view_perspective = "PERSP"
    region_3d.view_rotation = Euler((_TILT_RAD, 0.0, heading_rad(world_from_camera[:, :3, 2]))).to_quaternion()
    region_3d.view_location = ((low + high) / 2.0).tolist()
    region_3d.view_distance = _FARTHER * float(np.linalg.norm(high - low))


def heading_rad(forwards: np.ndarray) -> float:
    """The turn about z of a view that looks where cameras look on average, along ``forwards`` (N, 3)."""
    x, y, _ = forwards.mean(axis=0)
    return math.atan2(-x, y)


def hide_startup_cube(scene: bpy.types.Scene) -> None:
    """Hide the cube of Blender's startup file, if it is as it came: the room is around it."""
    cube = scene.objects.get("Cube")
    if cube is None or cube.type != "MESH" or len(cube.data.vertices) != 8:
        return
    untouched = cube.matrix_world.is_identity and not (cube.modifiers or cube.animation_data or cube.children)
    if untouched and all(abs(side - _STARTUP_CUBE_M) < 1e-6 for side in cube.dimensions):
        for layer in scene.view_layers:
            if cube.name in layer.objects:
                cube.hide_set(True, view_layer=layer)
