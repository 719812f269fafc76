"""The visual asset: looked at, rendered, compared, cleaned, exported, scored."""

import bpy
from bpy.props import PointerProperty

from .. import state
from . import facts, marks, properties
from .delete_splats import R2SEGO_OT_clear_splat_marks, R2SEGO_OT_delete_splats, R2SEGO_OT_restore_splats
from .evaluate import R2SEGO_OT_evaluate
from .export_asset import R2SEGO_OT_export_asset
from .mark_floaters import R2SEGO_OT_mark_floaters
from .mark_selected_splats import R2SEGO_OT_mark_selected_splats
from .mark_splats_box import R2SEGO_OT_add_splat_box, R2SEGO_OT_mark_splats_box
from .mark_splats_lasso import R2SEGO_OT_mark_splats_lasso
from .render_asset import R2SEGO_OT_render_asset
from .show_asset import R2SEGO_OT_show_asset
from .wipe import R2SEGO_OT_compare_photograph, R2SEGO_OT_move_wipe

CLASSES = (
    *properties.CLASSES,
    R2SEGO_OT_show_asset,
    R2SEGO_OT_render_asset,
    R2SEGO_OT_compare_photograph,
    R2SEGO_OT_move_wipe,
    R2SEGO_OT_add_splat_box,
    R2SEGO_OT_mark_splats_box,
    R2SEGO_OT_mark_splats_lasso,
    R2SEGO_OT_mark_selected_splats,
    R2SEGO_OT_mark_floaters,
    R2SEGO_OT_clear_splat_marks,
    R2SEGO_OT_delete_splats,
    R2SEGO_OT_restore_splats,
    R2SEGO_OT_export_asset,
    R2SEGO_OT_evaluate,
)


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
