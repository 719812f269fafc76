"""The room Trials: a study's plan, its session on a real robot, and where robot and chair are to stand.

Begin with ``facts.py`` (what the study's folder holds) and ``session.py`` (what a running session tells); each
other file is an operator. Of no scene bundle: a study is a folder of its own. May use ``bridge/trials`` and the
library, no other room.
"""

import bpy

from ...r2sego_blender.bridge.shared import versions
from ...r2sego_blender.trials.running.live import LIVE_EVENT
from .. import job
from . import facts, session
from .properties import R2SEGO_PG_trials

_HANDLERS = (
    (bpy.app.handlers.load_post, facts.read_again),
    (versions.AFTER_IMPORT, facts.catch_up),
    (bpy.app.handlers.undo_post, facts.catch_up),
    (bpy.app.handlers.redo_post, facts.catch_up),
)


def register() -> None:
    """Attach the room's properties, and hear what sessions tell."""
    bpy.types.Scene.r2sego_trials = bpy.props.PointerProperty(type=R2SEGO_PG_trials)
    job.listeners[LIVE_EVENT] = session.hear
    for handlers, handler in _HANDLERS:
        handlers.append(handler)


def unregister() -> None:
    """Take them away again."""
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
    del job.listeners[LIVE_EVENT]
    session.forget()
    facts.forget()
    del bpy.types.Scene.r2sego_trials
