"""What holds of the room Engine, checked inside Blender."""

import sys
import time

import bpy
from support import BUNDLE, ENGINE, MODULE, conduct, open_bundle, preferences, refused

OPERATORS = {"cancel", "check_engine", "set_up_engine"}


def check_a_failing_engine_is_reported_in_its_own_words():
    open_bundle()
    conduct("fail")
    assert "images/a.png: it is empty" in refused(bpy.ops.r2sego.refine)
    assert not bpy.context.window_manager.r2sego_job.running
    conduct("succeed")
    assert bpy.ops.r2sego.refine() == {"FINISHED"}


def check_disabling_ends_a_running_engine_within_two_seconds():
    import addon_utils

    open_bundle()
    conduct("sleep")
    job = sys.modules[f"{MODULE}.operators.job"]
    engine = job.start(["refine", str(BUNDLE)], "Refine")
    while not engine.events():
        time.sleep(0.01)
    assert "busy" in refused(bpy.ops.r2sego.refine)
    started_s = time.monotonic()
    addon_utils.disable(MODULE, default_set=False)
    assert time.monotonic() - started_s < 2.0
    assert not engine.running()
    addon_utils.enable(MODULE, default_set=False)


def check_the_engines_answer_is_kept_in_the_preferences():
    assert bpy.ops.r2sego.check_engine() == {"FINISHED"}
    assert preferences().engine_found == "engine: Python 3.99, r2sego 0.1.0, torch 9.9"
    preferences().engine_python = "/nowhere/python"
    assert "/nowhere/python" in refused(bpy.ops.r2sego.check_engine)
    preferences().engine_python = str(ENGINE)


def check_setting_up_the_engine_needs_leave_to_go_online():
    assert not bpy.app.online_access
    assert "online access" in refused(bpy.ops.r2sego.set_up_engine)
