"""The engine: its set-up, the job that runs and those that ended."""

import bpy

from . import cancel, following, pictures
from .cancel import R2SEGO_OT_cancel
from .check_engine import R2SEGO_OT_check_engine
from .demo_scene import R2SEGO_OT_demo_scene
from .dismiss_job import R2SEGO_OT_dismiss_job
from .follow_job import R2SEGO_OT_follow_job
from .properties import R2SEGO_PG_ended_job, R2SEGO_PG_engine
from .set_up_engine import R2SEGO_OT_set_up_engine

CLASSES = (
    R2SEGO_PG_ended_job,
    R2SEGO_PG_engine,
    R2SEGO_OT_set_up_engine,
    R2SEGO_OT_check_engine,
    R2SEGO_OT_demo_scene,
    R2SEGO_OT_cancel,
    R2SEGO_OT_follow_job,
    R2SEGO_OT_dismiss_job,
)


def register() -> None:
    """Attach the engine's properties, and begin to follow jobs."""
    bpy.types.WindowManager.r2sego_engine = bpy.props.PointerProperty(type=R2SEGO_PG_engine)
    following.register()
    cancel.register()


def unregister() -> None:
    """Take all away again; a running job goes on."""
    cancel.unregister()
    following.unregister()
    pictures.clear(bpy.context.window_manager.r2sego_engine)
    del bpy.types.WindowManager.r2sego_engine
