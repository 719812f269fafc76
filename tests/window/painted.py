"""Show an asset as Gaussians from one place, and write what is painted of it, and a picture of the view.

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


def script():
    """The splats are seen from above, aslant, with perspective and without."""
    yield 1.0
    press.install()
    bpy.ops.r2sego.show_asset()
    preview = sys.modules["bl_ext.user_default.r2sego.panels.splat_preview"]
    area, _ = hand.view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    view = area.spaces.active.region_3d
    told = {}
    for kind in ("PERSP", "ORTHO"):
        view.view_perspective = kind
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
        }  # fmt: skip
        yield from hand.picture(kind)
    (hand.OUT / "told.json").write_text(json.dumps(told))


hand.perform(script())
