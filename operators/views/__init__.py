"""Candidate and target views."""

import bpy

from .. import state
from . import display, facts
from .look_through_candidate import R2SEGO_OT_look_through_candidate
from .pick_candidate import R2SEGO_OT_pick_candidate
from .properties import R2SEGO_PG_views
from .show_candidates import R2SEGO_OT_show_candidates

CLASSES = (
    R2SEGO_PG_views,
    R2SEGO_OT_show_candidates,
    R2SEGO_OT_pick_candidate,
    R2SEGO_OT_look_through_candidate,
)


def register() -> None:
    """Attach the room's properties; its facts are read whenever the bundle changed."""
    bpy.types.Scene.r2sego_views = bpy.props.PointerProperty(type=R2SEGO_PG_views)
    state.readers[facts.ViewFacts] = state.Reader(facts.read, facts.chosen_round)
    state.followers.append(display.follow_bundle)


def unregister() -> None:
    """Take them away again."""
    state.followers.remove(display.follow_bundle)
    del state.readers[facts.ViewFacts]
    del bpy.types.Scene.r2sego_views
