"""What holds of the room Report, checked inside Blender."""

import bpy
from support import open_bundle

OPERATORS = {"open_report"}


def check_the_report():
    open_bundle()
    assert bpy.ops.r2sego.open_report() == {"FINISHED"}
