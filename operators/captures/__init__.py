"""The room Captures: the photographs and their cameras, and the world's frame by hand.

Begin with ``properties.py`` (the picks, how captures are shown) and ``facts.py`` (the list, what picks come
to); each other file is an operator. May use ``bridge/captures`` and the library, no other room.
"""

import bpy
from bpy.props import PointerProperty

from ...r2sego_blender.results.panels.sparse_cloud import forget_clouds
from .. import state
from . import facts
from .properties import R2SEGO_PG_captures


def register() -> None:
    """Attach the properties, and read the captures of every opened bundle."""
    bpy.types.Scene.r2sego_captures = PointerProperty(type=R2SEGO_PG_captures)
    state.readers[facts.CaptureFacts] = state.Reader(facts.read)
    state.readers[facts.PickFacts] = state.Reader(facts.read_picks, facts.chosen_picks)
    state.followers.append(facts.follow)
    state.forgetters.append(facts.forget_bundle)


def unregister() -> None:
    """Take them away."""
    state.forgetters.remove(facts.forget_bundle)
    state.followers.remove(facts.follow)
    del state.readers[facts.PickFacts], state.readers[facts.CaptureFacts]
    forget_clouds()
    del bpy.types.Scene.r2sego_captures
