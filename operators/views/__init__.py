"""The room Views: the round's candidate and target views.

Begin with ``facts.py`` (the scores), ``properties.py`` (the active candidate) and ``display.py`` (the frusta
in the view). May use ``bridge/views`` and the library, no other room.
"""

import bpy

from .. import state
from . import display, facts
from .properties import R2SEGO_PG_views


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
