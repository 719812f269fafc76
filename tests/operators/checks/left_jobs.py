"""Jobs as a window leaves them, running, and what its timer makes of them: shared by the engine's checks."""

import sys
import time

import bpy
from support import MODULE


def job_module():
    return sys.modules[f"{MODULE}.operators.job"]


def wait_until(condition, limit_s=120.0):
    deadline_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.01)


def left_job(operator, **properties):
    """The job of an operator as it starts it with a window: running, and nobody waits for its end."""
    base = sys.modules[f"{MODULE}.operators.base"]
    waits, base.waits_for_engine = base.waits_for_engine, lambda context: False
    try:
        assert operator(**properties) == {"FINISHED"}
    finally:
        base.waits_for_engine = waits
    job = job_module().current()
    wait_until(job.events)
    return job


def other_scene_shown():
    """Another Blender scene, shown in place of the one that was."""
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    assert bpy.context.scene == other
    return other


def followed_to_its_end():
    """The line with which the job ended that the timer follows."""
    following = sys.modules[f"{MODULE}.operators.engine.following"]
    wait_until(lambda: following._tick() and not bpy.context.window_manager.r2sego_job.running)
    (end,) = bpy.context.window_manager.r2sego_engine.ended
    return end.line
