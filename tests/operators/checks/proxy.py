"""What holds of the room Proxy, checked inside Blender."""

import bpy
from support import open_bundle, refused, state

OPERATORS = {"show_proxy"}


def check_show_proxy():
    open_bundle()
    state().round_index = 0
    assert bpy.ops.r2sego.show_proxy() == {"FINISHED"}
    assert len(bpy.data.objects["Proxy, round 0"].data.polygons) == 13
    state().round_index = 9
    assert "round 9" in refused(bpy.ops.r2sego.show_proxy)
