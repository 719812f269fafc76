"""The operators, one a file, in the order of the work."""

import bpy

from . import job, state
from .cancel import R2SEGO_OT_cancel
from .check_engine import R2SEGO_OT_check_engine
from .evaluate import R2SEGO_OT_evaluate
from .export_collision import R2SEGO_OT_export_collision
from .import_captures import R2SEGO_OT_import_captures
from .look_through import R2SEGO_OT_look_through
from .new_scene import R2SEGO_OT_new_scene
from .open_report import R2SEGO_OT_open_report
from .open_scene import R2SEGO_OT_open_scene
from .refine import R2SEGO_OT_refine
from .refresh_scene import R2SEGO_OT_refresh_scene
from .render_conditions import R2SEGO_OT_render_conditions
from .reset_settings import R2SEGO_OT_reset_settings
from .set_up_engine import R2SEGO_OT_set_up_engine
from .show_candidates import R2SEGO_OT_show_candidates
from .show_collision import R2SEGO_OT_show_collision
from .show_proxy import R2SEGO_OT_show_proxy

_CLASSES = (
    R2SEGO_OT_set_up_engine,
    R2SEGO_OT_check_engine,
    R2SEGO_OT_new_scene,
    R2SEGO_OT_open_scene,
    R2SEGO_OT_refresh_scene,
    R2SEGO_OT_import_captures,
    R2SEGO_OT_look_through,
    R2SEGO_OT_refine,
    R2SEGO_OT_reset_settings,
    R2SEGO_OT_cancel,
    R2SEGO_OT_show_proxy,
    R2SEGO_OT_show_candidates,
    R2SEGO_OT_render_conditions,
    R2SEGO_OT_show_collision,
    R2SEGO_OT_export_collision,
    R2SEGO_OT_evaluate,
    R2SEGO_OT_open_report,
)


def register() -> None:
    """Add the properties and the operators."""
    state.register()
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """End a running command, then take the operators and properties away."""
    job.end()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    state.unregister()
