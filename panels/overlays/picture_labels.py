"""The overlay of the captures' names beside their cameras."""

import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

from ...r2sego_blender.bridge.captures.show_captures import capture_cameras, capture_name
from ...r2sego_blender.bridge.shared.moved_bundle import whole_path
from .flat_shapes import write
from .overlay import Overlay

_MOST = 60
"""With more captures their names would only cover the room."""

_CHOSEN, _OTHERS = (1.0, 0.75, 0.3, 1.0), (0.9, 0.9, 0.9, 0.85)


def labelled(context):
    """The captures' cameras that the 3D view shows."""
    cameras = capture_cameras(context.scene, whole_path(context.scene.r2sego.bundle))
    return [camera for camera in cameras if camera.visible_get(viewport=context.space_data)]


def _draw(context):
    scene = context.scene
    shown = getattr(scene, "r2sego_captures", None)
    if shown is None or not shown.show_labels or not 0 < len(shown.captures) <= _MOST:
        return
    if not context.space_data.overlay.show_overlays or context.region_data.view_perspective == "CAMERA":
        return
    scale = context.preferences.system.ui_scale
    chosen = shown.captures[min(shown.active_capture, len(shown.captures) - 1)].name
    for camera in labelled(context):
        place = location_3d_to_region_2d(context.region, context.region_data, camera.matrix_world.translation)
        if place is not None:
            name = capture_name(camera)
            left, bottom = np.array(place) + 6.0 * scale
            shown_name = name.rpartition(".")[0] or name  # as in the list
            write(shown_name, left, bottom, _CHOSEN if name == chosen else _OTHERS, 11.0 * scale)


LABELS = Overlay(_draw, "POST_PIXEL")
