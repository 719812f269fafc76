"""The geometry proxy: looked at and mended."""

import bpy
from bpy.props import PointerProperty

from ...r2sego_blender.bridge.proxy import placement_live
from .. import state
from . import facts, masks, place_prior, properties
from .edit_proxy import (
    R2SEGO_OT_cut_proxy,
    R2SEGO_OT_draw_proxy_surface,
    R2SEGO_OT_remove_proxy_edit,
)
from .measure_coverage import R2SEGO_OT_measure_coverage
from .plan_refine import R2SEGO_OT_plan_refine
from .select_box import R2SEGO_OT_select_proxy_box
from .select_lasso import R2SEGO_OT_select_proxy_lasso
from .show_proxy import R2SEGO_OT_show_proxy

CLASSES = (
    *properties.CLASSES,
    R2SEGO_OT_show_proxy,
    R2SEGO_OT_measure_coverage,
    R2SEGO_OT_select_proxy_lasso,
    R2SEGO_OT_select_proxy_box,
    R2SEGO_OT_cut_proxy,
    R2SEGO_OT_draw_proxy_surface,
    R2SEGO_OT_remove_proxy_edit,
    *masks.CLASSES,
    *place_prior.CLASSES,
    R2SEGO_OT_plan_refine,
)

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
