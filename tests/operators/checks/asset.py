"""What holds of the room Asset, checked inside Blender."""

import bpy
from support import BUNDLE, calls, conduct, open_bundle

OPERATORS = {"evaluate"}


def check_evaluating_asks_the_engine():
    open_bundle()
    conduct("succeed")
    assert bpy.ops.r2sego.evaluate(filepath="/frozen.json") == {"FINISHED"}
    assert calls() == [["evaluate", str(BUNDLE), "--frozen", "/frozen.json", "--json-progress"]]
