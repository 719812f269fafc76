"""The overlay of picked points: in a photograph where they were picked and by how much they miss,
in the room where they lie, and the known lengths between them."""

import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d

from ...r2sego_blender.bridge.captures.show_captures import looked_through
from ...r2sego_blender.bridge.shared.cameras import camera_of, has_lens
from ...r2sego_blender.bridge.shared.moved_bundle import whole_path
from ...r2sego_blender.bridge.shared.views_3d import looks_through_scene_camera
from ...r2sego_blender.results.panels.registration_pixels import points_at
from .flat_shapes import segments, write
from .overlay import Overlay

_POINT, _FLOOR, _LENGTH = (1.0, 0.75, 0.2, 1.0), (0.35, 0.95, 0.45, 1.0), (0.5, 0.8, 1.0, 1.0)
_MISS = (1.0, 0.25, 0.2, 1.0)
_ARM_PX = 8.0


def _draw(context):
    shown = getattr(context.scene, "r2sego_captures", None)
    if shown is None or not shown.show_picks or not len(shown.points):
        return
    if not context.space_data.overlay.show_overlays:
        return
    scale = context.preferences.system.ui_scale
    placed = {point.name: point.placed for point in shown.points if point.placed is not None}
    seen = {name: _on_screen(context, one.position) for name, one in placed.items()}
    picked = _picked_here(context, shown)
    for point in shown.points:
        place = picked.get(point.name, seen.get(point.name))
        if place is None:
            continue
        _cross(place, _FLOOR if point.floor else _POINT, scale)
        write(_label(point.name, placed if point.name in picked else {}), *(place + 7.0 * scale), size_px=12.0 * scale)
        if point.name in picked and seen.get(point.name) is not None:
            segments(np.stack([place, seen[point.name]]), _MISS, 2.0 * scale)
    for length in shown.lengths:
        ends = seen.get(length.start), seen.get(length.end)
        if ends[0] is not None and ends[1] is not None:
            segments(np.stack(ends), _LENGTH, 1.5 * scale)
            write(f"{length.metres:.3f} m", *(0.5 * (ends[0] + ends[1])), _LENGTH, 11.0 * scale)


def _picked_here(context, shown):
    """Where points were picked in the photograph that is looked through, pixels of the region."""
    camera = context.scene.camera
    if not (looks_through_scene_camera(context) and has_lens(camera)):
        return {}
    name, lens = looked_through(context.scene, whole_path(context.scene.r2sego.bundle)), camera_of(camera)
    places = {}
    for point in shown.points:
        for view in point.views:
            if view.capture == name:
                (position,) = points_at(lens, (view.x_px, view.y_px))
                places[point.name] = _on_screen(context, position)
    return {key: place for key, place in places.items() if place is not None}


def _on_screen(context, position):
    place = location_3d_to_region_2d(context.region, context.region_data, position)
    return None if place is None else np.array(place)


def _label(name, placed):
    off_px = placed[name].off_px if name in placed else -1.0
    return f"{name}  {off_px:.1f} px" if off_px >= 0.0 else name


def _cross(place, colour, scale):
    arm = _ARM_PX * scale
    offsets = np.array([[-arm, 0.0], [arm, 0.0], [0.0, -arm], [0.0, arm]])
    segments(place + offsets, colour, 2.0 * scale)


REGISTRATION = Overlay(_draw, "POST_PIXEL")
