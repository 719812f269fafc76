"""Pinholes in pixels of any Blender camera, and of what a 3D view shows."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.cameras import Camera, is_rigid
from ...core.errors import SceneError
from ..shared.cameras import camera_of, has_lens, keeps_lens, rigid

_OPENCV_FROM_BLENDER = np.diag([1.0, -1.0, -1.0, 1.0])


def exact_camera(camera_object: bpy.types.Object, scene: bpy.types.Scene) -> Camera:
    """What a camera object sees: by its own lens in pixels while it keeps it, else by Blender's and the scene's size.

    Raises SceneError for a camera that is no pinhole, and for one that is mirrored or skewed.
    """
    if camera_object is not None and not is_rigid(rigid(np.array(camera_object.matrix_world))):
        raise SceneError(
            "this camera is mirrored or skewed",
            where=camera_object.name,
            cure="Clear its scale with Alt S, and that of its parents.",
        )
    if has_lens(camera_object) and keeps_lens(camera_object):
        return camera_of(camera_object)
    if camera_object is None or camera_object.type != "CAMERA" or camera_object.data.type != "PERSP":
        raise SceneError(
            "this is no perspective camera",
            where=getattr(camera_object, "name", "no object"),
            cure="Choose a camera of the type Perspective.",
        )
    data, render = camera_object.data, scene.render
    width, height = (side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    horizontal = data.sensor_fit == "HORIZONTAL"
    if data.sensor_fit == "AUTO":
        horizontal = width * render.pixel_aspect_x >= height * render.pixel_aspect_y
    # Blender measures in pixels of the width; those of the height are ``aspect`` as high.
    fitted_px = width if horizontal else aspect * height
    sensor_mm = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    fx = data.lens * fitted_px / sensor_mm
    return Camera(
        width,
        height,
        fx,
        fx / aspect,
        0.5 * width - data.shift_x * fitted_px,
        0.5 * height + data.shift_y * fitted_px / aspect,
        rigid(np.array(camera_object.matrix_world)) @ _OPENCV_FROM_BLENDER,
    )


def view_camera(view_matrix: np.ndarray, window_matrix: np.ndarray, width: int, height: int) -> tuple[Camera, bool]:
    """The camera of a 3D view whose region has this size, and whether its rays are parallel.

    The matrices (4, 4) are those of its ``region_3d``. A parallel camera's ``fx`` and ``fy`` are in
    pixels a metre. Pixels count from the top left corner.
    """
    projection = np.asarray(window_matrix, np.float64)
    parallel = bool(projection[3, 3] == 1.0)
    # The offset stands in the depth's column of a perspective, which looks along -z.
    right, up = (projection[:2, 3]) if parallel else -projection[:2, 2]
    camera = Camera(
        width,
        height,
        projection[0, 0] * width / 2.0,
        projection[1, 1] * height / 2.0,
        (1.0 + right) * width / 2.0,
        (1.0 - up) * height / 2.0,
        rigid(np.linalg.inv(np.asarray(view_matrix, np.float64))) @ _OPENCV_FROM_BLENDER,
    )
    return camera, parallel
