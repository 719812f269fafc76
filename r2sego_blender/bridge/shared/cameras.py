"""Pinhole cameras in Blender: OpenCV poses and pixel lenses to objects, and back.

Blender's cameras look along -Z with +Y up; unequal ``fx`` and ``fy`` become the scene's
pixel aspect, the principal point becomes the lens shift. Both conversions are exact, so a
render of the camera lines up with its photograph to the pixel.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...core.cameras import Camera
from ...core.errors import SceneError

SENSOR_WIDTH_MM = 36.0
_LENS_KEY = "r2sego_lens"
_BLENDER_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def object_pose(world_from_camera: np.ndarray) -> np.ndarray:
    """Blender's ``matrix_world`` (4, 4) of an OpenCV ``world_from_camera``."""
    return np.asarray(world_from_camera, np.float64) @ _BLENDER_FROM_OPENCV


def pixel_aspect(camera: Camera) -> tuple[float, float]:
    """The scene's (x, y) pixel aspect for this lens; the smaller is 1, Blender's least."""
    return max(1.0, camera.fy / camera.fx), max(1.0, camera.fx / camera.fy)


def create_camera(name: str, camera: Camera) -> bpy.types.Object:
    """A camera object with this lens and pose, not linked to any collection yet."""
    data = bpy.data.cameras.new(name)
    data.clip_start, data.clip_end = 0.01, 1000.0
    created = bpy.data.objects.new(name, data)
    set_camera(created, camera)
    return created


def set_camera(camera_object: bpy.types.Object, camera: Camera) -> None:
    """Give an object made by ``create_camera`` another lens and pose."""
    data = camera_object.data
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_WIDTH_MM
    data.lens, data.shift_x, data.shift_y = _blender_lens(camera)
    data[_LENS_KEY] = [camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy]
    camera_object.matrix_world = object_pose(camera.world_from_camera).T.tolist()


def has_lens(candidate: bpy.types.Object | None) -> bool:
    """Whether this is a camera made by ``create_camera``."""
    return candidate is not None and candidate.type == "CAMERA" and _LENS_KEY in candidate.data


def keeps_lens(camera_object: bpy.types.Object) -> bool:
    """Whether the lens of an object made by ``create_camera`` is as it was made: a person may zoom with it."""
    data = camera_object.data
    if data.type != "PERSP" or data.sensor_fit != "HORIZONTAL":
        return False
    now = (data.lens, data.shift_x, data.shift_y, data.sensor_width)
    return np.allclose(now, (*_blender_lens(camera_of(camera_object)), SENSOR_WIDTH_MM), rtol=1e-5, atol=1e-6)


def camera_of(camera_object: bpy.types.Object) -> Camera:
    """The camera of an object made by ``create_camera``, where it stands now.

    Raises SceneError when the object carries no lens.
    """
    if not has_lens(camera_object):
        raise SceneError(
            "this object carries no lens in pixels",
            where=getattr(camera_object, "name", "no object"),
            cure="Choose a camera that Import Captures or Show Candidates made.",
        )
    width, height, fx, fy, cx, cy = camera_object.data[_LENS_KEY]
    pose = rigid(np.array(camera_object.matrix_world)) @ _BLENDER_FROM_OPENCV
    return Camera(int(width), int(height), fx, fy, cx, cy, pose)


def _blender_lens(camera: Camera) -> tuple[float, float, float]:
    """Blender's focal length, and its shifts."""
    return (
        camera.fx * SENSOR_WIDTH_MM / camera.width,
        0.5 - camera.cx / camera.width,
        # Both shifts are in units of the width; rows are fx / fy wide pixels high.
        (camera.cy - 0.5 * camera.height) * (camera.fx / camera.fy) / camera.width,
    )


def rigid(pose: np.ndarray) -> np.ndarray:
    """A pose (4, 4) without its scale, which Blender's cameras do not heed."""
    pose = np.array(pose, np.float64)
    pose[:3, :3] /= np.maximum(np.linalg.norm(pose[:3, :3], axis=0), 1e-12)
    return pose


def use_frame_of(camera_object: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Make the object the scene's camera, with the size and pixel aspect its lens needs."""
    camera = camera_of(camera_object)
    if scene.camera != camera_object:  # setting it again would make renders load the whole scene anew
        scene.camera = camera_object
    scene.render.resolution_x, scene.render.resolution_y = camera.width, camera.height
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = pixel_aspect(camera)
