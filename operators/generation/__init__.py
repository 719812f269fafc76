"""The room Generation: conditions, clips and kept frames of a round.

Begin with ``facts.py`` (the list of views) and ``views.py`` (which view an operator means); each other file
is an operator. May use ``bridge/generation`` and the library, no other room.
"""

import bpy

from .. import state
from . import facts
from .properties import R2SEGO_PG_generation


def register() -> None:
    """Attach the room's properties; its views are read whenever the bundle changed."""
    bpy.types.Scene.r2sego_generation = bpy.props.PointerProperty(type=R2SEGO_PG_generation)
    state.readers[facts.GenerationFacts] = state.Reader(facts.read, facts.chosen_round)
    state.followers.append(facts.follow)
    state.forgetters.append(facts.forget_bundle)


def unregister() -> None:
    """Take them away again."""
    state.forgetters.remove(facts.forget_bundle)
    state.followers.remove(facts.follow)
    del state.readers[facts.GenerationFacts]
    del bpy.types.Scene.r2sego_generation
