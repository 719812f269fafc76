"""The room Asset: the visual asset looked at, rendered, compared, cleaned, exported, scored.

Begin with ``properties.py`` (what a person chose) and ``facts.py`` (what the bundle has); each other file is
an operator, or what several share. May use ``bridge/asset`` and the library, no other room.
"""

import bpy
from bpy.props import PointerProperty

from .. import state
from . import facts, marks, properties


def register() -> None:
    """Attach the room's properties and read each bundle that is opened."""
    bpy.types.Scene.r2sego_asset = PointerProperty(type=properties.R2SEGO_PG_asset)
    state.readers[facts.AssetFacts] = state.Reader(facts.read)
    state.followers.append(properties.follow)
    state.forgetters.append(properties.forget_bundle)
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.append(marks.undone)


def unregister() -> None:
    """Take them away again."""
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.remove(marks.undone)
    state.forgetters.remove(properties.forget_bundle)
    state.followers.remove(properties.follow)
    del state.readers[facts.AssetFacts]
    del bpy.types.Scene.r2sego_asset
