"""What holds of the room Views, checked inside Blender."""

import bpy
from support import open_bundle

OPERATORS = {"show_candidates"}


def check_show_candidates():
    open_bundle()
    assert bpy.ops.r2sego.show_candidates(frustum_size=0.1) == {"FINISHED"}
    assert bpy.data.objects["Target 00"]["candidate"] == 17
