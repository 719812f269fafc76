"""The room Engine: its set-up, the job that runs and those that ended.

Begin with ``following.py``, the timer that follows a job, beside ``../job.py``; each button is a file of its
own. May use the library's ``workers/jobs`` and ``state``, no other room: it calls operators by their names.
"""

import bpy

from . import cancel, following, pictures
from .properties import R2SEGO_PG_engine


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
