"""What holds of the room Collision, checked inside Blender."""

import bpy
from support import BUNDLE, calls, conduct, open_bundle

OPERATORS = {"export_collision", "show_collision"}


def check_show_collision():
    open_bundle()
    assert bpy.ops.r2sego.show_collision() == {"FINISHED"}


def check_exporting_asks_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.export_collision(directory="/out") == {"FINISHED"}
    assert calls() == [["export", str(BUNDLE), "--to", "/out"]]
