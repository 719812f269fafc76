"""The room Geometry Proxy: looked at and mended, with objects, their masks and their priors.

Begin with ``properties.py`` (what a person chose and drew) and ``facts.py`` (what the bundle has); each other
file is an operator or a family of them. May use ``bridge/proxy`` and the library, and asks Refine's operator
for its arguments.
"""

import bpy
from bpy.props import PointerProperty

from ...r2sego_blender.bridge.proxy import placement_live
from .. import state
from . import facts, place_prior, properties

_HANDLERS = (
    (bpy.app.handlers.depsgraph_update_post, place_prior.follow),
    (bpy.app.handlers.undo_post, place_prior.undone),
    (bpy.app.handlers.redo_post, place_prior.undone),
    (bpy.app.handlers.load_pre, place_prior.forget),
    (bpy.app.handlers.load_post, place_prior.opened),
)


def register() -> None:
    """Attach the room's properties, read each bundle that is opened, follow a prior that is moved."""
    bpy.types.Scene.r2sego_proxy = PointerProperty(type=properties.R2SEGO_PG_proxy)
    state.readers[facts.ProxyFacts] = state.Reader(facts.read, facts.chosen_round)
    state.followers.append(properties.follow)
    state.forgetters.append(properties.forget_bundle)
    for handlers, handler in _HANDLERS:
        handlers.append(handler)


def unregister() -> None:
    """Take them away again."""
    for handlers, handler in _HANDLERS:
        handlers.remove(handler)
    placement_live.forget()
    state.forgetters.remove(properties.forget_bundle)
    state.followers.remove(properties.follow)
    del state.readers[facts.ProxyFacts]
    del bpy.types.Scene.r2sego_proxy
