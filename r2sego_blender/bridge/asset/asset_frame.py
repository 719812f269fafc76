"""Where a 3D view shows its camera's frame."""

from __future__ import annotations

import bpy
import numpy as np

from ..shared.views_3d import looks_through_scene_camera


def camera_frame_px(context: bpy.types.Context) -> tuple[float, float, float, float] | None:
    """Left, bottom, width and height of the camera's frame, pixels of the context's region.

    None where its view does not look through the scene's camera.
    """
    scene, region, view = context.scene, context.region, context.region_data
    camera = scene.camera
    if not looks_through_scene_camera(context) or camera.type != "CAMERA":
        return None
    corners = np.ones((4, 4))
    corners[:, :3] = camera.data.view_frame(scene=scene)
    pose = np.array(camera.matrix_world.normalized())
    return frame_px(corners @ pose.T, np.array(view.perspective_matrix), region.width, region.height)


def frame_px(
    corners: np.ndarray, perspective_matrix: np.ndarray, width: int, height: int
) -> tuple[float, float, float, float]:
    """Left, bottom, width and height of the box around homogeneous world points (N, 4), in pixels."""
    clip = corners @ perspective_matrix.T
    pixels = (clip[:, :2] / clip[:, 3:] + 1.0) * (width / 2.0, height / 2.0)
    (left, bottom), (right, top) = pixels.min(axis=0), pixels.max(axis=0)
    return float(left), float(bottom), float(right - left), float(top - bottom)
