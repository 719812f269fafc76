"""The room Trials: a study's plan, its session on a real robot, and where robot and chair are to stand.

Begin with ``facts.py`` (what the study's folder holds) and ``session.py`` (what a running session tells); each
other file is an operator. Of no scene bundle: a study is a folder of its own. May use ``bridge/trials`` and the
library, no other room.
"""

import bpy

from ...r2sego_blender.trials.running.live import LIVE_EVENT
from .. import job
from . import facts, session
from .properties import R2SEGO_PG_trials


def register() -> None:
    """Attach the room's properties, and hear what sessions tell."""
    bpy.types.Scene.r2sego_trials = bpy.props.PointerProperty(type=R2SEGO_PG_trials)
    job.listeners[LIVE_EVENT] = session.hear
    for handlers in (bpy.app.handlers.load_post, bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.append(facts.catch_up)


def unregister() -> None:
    """Take them away again."""
    for handlers in (bpy.app.handlers.load_post, bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.remove(facts.catch_up)
    del job.listeners[LIVE_EVENT]
    session.forget()
    facts.forget()
    del bpy.types.Scene.r2sego_trials
