"""Show an asset as Gaussians from one place, and write what is painted of it, and pictures of the view.

blender --enable-event-simulate --python painted.py -- OUT ZIP BUNDLE ENGINE
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import hand  # found beside this file
import press  # its install()
from mathutils import Euler

SETTLES_S = 3.0
KEPT = [
    (1.0, 0.0, 0.0, 0.3),
    (0.0, 1.0, 0.0, 9.0),
    (0.0, 0.0, -1.0, 1.2),
    (0.6, 0.8, 0.0, 0.5),
    *2 * [4 * (0.0,)],
]


def left_half(view):
    """The planes of a Clipping Region that keeps the left half of a view."""
    eye, right = view.view_matrix.inverted().translation, view.view_matrix[0].xyz
    return [(*-right, right.dot(eye)), *3 * [(0.0, 0.0, 0.0, 1.0)], *2 * [4 * (0.0,)]]


def script():
    """The splats are seen from above, aslant, with perspective and without, and in parts."""
    yield 1.0
    press.install()
    bpy.ops.r2sego.show_asset()
    preview = sys.modules["bl_ext.user_default.r2sego.panels.splat_preview"]
    area, _ = hand.view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    view = area.spaces.active.region_3d
    told = {}
    for kind in ("PERSP", "ORTHO", "CLIPPED"):
        view.view_perspective = "ORTHO" if kind == "ORTHO" else "PERSP"
        view.use_clip_planes = kind == "CLIPPED"
        view.clip_planes = KEPT
        view.view_location, view.view_distance = (0.0, 0.0, 1.0), 4.0
        view.view_rotation = Euler((1.1, 0.0, 0.4)).to_quaternion()
        yield SETTLES_S
        (buffers,) = preview._buffers.values()
        picture = buffers.gaussians._pictures[region.as_pointer()]
        width, height = picture.size
        for name, channels in (("colours", 4), ("nearnesses", 2)):
            values = np.array(getattr(picture, name).read().to_list(), np.float32)
            np.save(hand.OUT / f"{kind}_{name}.npy", values.reshape(height, width, channels))
        told[kind] = {
            "view": np.array(view.view_matrix).tolist(), "window": np.array(view.window_matrix).tolist(),
            "kept": np.array(view.clip_planes).reshape(-1, 4).tolist(),
        }  # fmt: skip
        yield from hand.picture(kind)
    bpy.data.objects.remove(bpy.data.objects["Cube"])  # which hides the points
    bpy.data.objects["Light"].select_set(True)
    view.clip_planes = left_half(view)
    told["middle_px"] = area.x + region.width // 2
    bpy.context.scene.r2sego_asset.style = "DISCS"
    shown = {"nothing": (False, False), "discs": (True, False), "points": (False, True)}
    for where in ("clipped", "local", "whole"):
        view.use_clip_planes = where == "clipped"
        with bpy.context.temp_override(window=hand.window(), area=area, region=region):
            if where != "clipped":  # into the Local View of the light, and back
                bpy.ops.view3d.localview(frame_selected=False)
        for name, (asset, points) in shown.items():
            bpy.context.scene.r2sego_asset.preview = asset
            bpy.context.scene.r2sego_captures.show_cloud = points
            yield SETTLES_S
            yield from hand.picture(f"{name}_{where}")
    (hand.OUT / "told.json").write_text(json.dumps(told))


bpy.context.preferences.view.show_splash = False
hand.perform(script())
