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
MARGIN_PX = 60
KEPT = [(1.0, 0.0, 0.0, 0.3), (0.0, 1.0, 0.0, 9.0), (0.0, 0.0, -1.0, 1.2), (0.6, 0.8, 0.0, 0.5), *2 * [4 * (0.0,)]]


def left_half(view):
    """The planes of a Clipping Region that keeps the left half of a view."""
    eye, right = view.view_matrix.inverted().translation, view.view_matrix[0].xyz
    return [(*-right, right.dot(eye)), *3 * [(0.0, 0.0, 0.0, 1.0)], *2 * [4 * (0.0,)]]


def lasso(area, region):
    """The centres (M, 3) of the splats that a lasso around nearly the whole view marks."""
    right, top = area.x + region.width - MARGIN_PX, area.y + region.height - MARGIN_PX
    left, low = area.x + MARGIN_PX, area.y + MARGIN_PX
    with bpy.context.temp_override(window=hand.window(), area=area, region=region):
        bpy.ops.r2sego.mark_splats_lasso("INVOKE_DEFAULT")
    yield from hand.drag([(left, low), (right, low), (right, top), (left, top)])
    mesh = bpy.context.scene.r2sego_asset.shown.data
    marked, places = np.empty(len(mesh.vertices), bool), np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["marked"].data.foreach_get("value", marked)
    mesh.vertices.foreach_get("co", places)
    bpy.ops.r2sego.clear_splat_marks()
    return places.reshape(-1, 3)[marked]


def script():
    """The splats are seen from above, aslant, with perspective and without, and in parts."""
    yield 1.0
    press.install()
    bpy.ops.r2sego.show_asset()
    preview = sys.modules["bl_ext.user_default.r2sego.panels.overlays.splat_preview"]
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
            "view": np.array(view.view_matrix).tolist(),
            "window": np.array(view.window_matrix).tolist(),
            "kept": np.array(view.clip_planes).reshape(-1, 4).tolist(),
        }
        yield from hand.picture(kind)
        if kind == "PERSP":
            told[kind]["origin"] = [region.x, region.y]
            bpy.context.scene.r2sego_asset.preview = False
            yield 1.0
            yield from hand.picture("without")
            bpy.context.scene.r2sego_asset.preview = True
    bpy.data.objects.remove(bpy.data.objects["Cube"])  # which hides the points
    bpy.data.objects["Light"].select_set(True)
    view.clip_planes = left_half(view)
    told["left_half"] = np.array(view.clip_planes).reshape(-1, 4)[0].tolist()
    told["middle_px"] = area.x + region.width // 2
    bpy.context.scene.r2sego_asset.style = "DISCS"
    shown = {"nothing": (False, False), "discs": (True, False), "points": (False, True)}
    for where in ("clipped", "local", "whole"):
        view.use_clip_planes = where == "clipped"
        with bpy.context.temp_override(window=hand.window(), area=area, region=region):
            if where != "clipped":  # into the Local View of the light, and back
                bpy.ops.view3d.localview(frame_selected=False)
        if where != "local":
            bpy.context.scene.r2sego_asset.preview = True
            held = yield from lasso(area, region)
            np.save(hand.OUT / f"held_{where}.npy", held)
        for name, (asset, points) in shown.items():
            bpy.context.scene.r2sego_asset.preview = asset
            bpy.context.scene.r2sego_captures.show_cloud = points
            yield SETTLES_S
            yield from hand.picture(f"{name}_{where}")
    (hand.OUT / "told.json").write_text(json.dumps(told))


bpy.context.preferences.view.show_splash = False
hand.perform(script())
