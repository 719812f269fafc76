"""Outlines in a capture's camera view: the objects' masks, and the prior that is being placed."""

import numpy as np

from ...r2sego_blender.bridge.asset.asset_frame import camera_frame_px
from ...r2sego_blender.bridge.captures.show_captures import looked_through
from ...r2sego_blender.bridge.proxy.placement_live import followed, mask_outline, prior_outline
from ...r2sego_blender.bridge.shared.moved_bundle import whole_path
from .flat_shapes import segments, write
from .overlay import Overlay

_MASK, _OTHER, _PRIOR = (1.0, 0.85, 0.2, 1.0), (1.0, 0.85, 0.2, 0.45), (0.1, 0.95, 0.85, 1.0)


def on_screen(shares, frame):
    """(N, 2) pixels of the region of shares (N, 2) of the camera's frame, which count from its top left."""
    left, bottom, width, height = frame
    return np.stack([left + shares[:, 0] * width, bottom + (1.0 - shares[:, 1]) * height], axis=1)


def _draw(context):
    group = getattr(context.scene, "r2sego_proxy", None)
    if group is None or not group.show_outlines:
        return
    bundle_path = whole_path(context.scene.r2sego.bundle)
    capture = looked_through(context.scene, bundle_path)
    if not capture:
        return
    if not context.space_data.overlay.show_overlays:
        return
    frame = camera_frame_px(context)
    if frame is None:
        return
    scale = context.preferences.system.ui_scale
    active = group.object_index
    for index, item in enumerate(group.objects):
        chosen = index == active
        lines = mask_outline(bundle_path, item.name, capture)
        segments(on_screen(lines, frame), _MASK if chosen else _OTHER, (2.0 if chosen else 1.0) * scale)
    shown = context.view_layer.objects.active
    if not group.fit_object or shown is None or not followed(shown):
        return
    if shown.visible_get(viewport=context.space_data):
        segments(on_screen(prior_outline(shown, capture), frame), _PRIOR, 2.0 * scale)
        text = f"{group.fit_object}: overlap {group.fit_iou:.2f}"
        if group.fit_residual >= 0.0:
            text += f", points {100.0 * group.fit_residual:.1f} cm off"
        # At the top: charts of other rooms stand at the bottom.
        write(text, frame[0] + 12.0 * scale, frame[1] + frame[3] - 24.0 * scale, size_px=13.0 * scale)


PLACEMENT = Overlay(_draw, "POST_PIXEL")
