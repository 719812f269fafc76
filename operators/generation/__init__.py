"""Conditions, clips and kept frames."""

import bpy

from .. import state
from . import facts
from .compare_view import R2SEGO_OT_compare_view
from .decide_view import R2SEGO_OT_decide_view
from .play_clip import R2SEGO_OT_play_clip
from .properties import R2SEGO_PG_generation
from .render_conditions import R2SEGO_OT_render_conditions
from .render_target_views import R2SEGO_OT_render_target_views
from .show_camera_path import R2SEGO_OT_show_camera_path

CLASSES = (
    R2SEGO_PG_generation,
    R2SEGO_OT_render_conditions,
    R2SEGO_OT_decide_view,
    R2SEGO_OT_compare_view,
    R2SEGO_OT_render_target_views,
    R2SEGO_OT_show_camera_path,
    R2SEGO_OT_play_clip,
)


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
