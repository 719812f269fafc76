"""Candidate and target views."""

import bpy

from ...r2sego_blender.results.panels import view_scores
from .. import state
from . import display
from .look_through_candidate import R2SEGO_OT_look_through_candidate
from .pick_candidate import R2SEGO_OT_pick_candidate
from .properties import R2SEGO_PG_ranked_view, R2SEGO_PG_views
from .show_candidates import R2SEGO_OT_show_candidates

CLASSES = (
    R2SEGO_PG_ranked_view,
    R2SEGO_PG_views,
    R2SEGO_OT_show_candidates,
    R2SEGO_OT_pick_candidate,
    R2SEGO_OT_look_through_candidate,
)


def register() -> None:
    """Attach the room's properties; its facts are read whenever the bundle changed."""
    bpy.types.Scene.r2sego_views = bpy.props.PointerProperty(type=R2SEGO_PG_views)
    state.listeners.append(display.read)
    for handlers, handler in _HANDLERS:
        handlers.append(handler)


def unregister() -> None:
    """Take them away again."""
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
    state.listeners.remove(display.read)
    view_scores.forget_all()
    del bpy.types.Scene.r2sego_views


@bpy.app.handlers.persistent
def _another_file(*_: object) -> None:
    """The scenes whose scores are remembered go."""
    view_scores.forget_all()


_HANDLERS = (
    (bpy.app.handlers.load_pre, _another_file),
    (bpy.app.handlers.undo_post, display.undone),
    (bpy.app.handlers.redo_post, display.undone),
)
