"""The scene bundle, its refinement, and how heavily it is drawn."""

from .kept_settings import R2SEGO_OT_keep_settings, R2SEGO_OT_load_settings, R2SEGO_OT_remove_settings
from .new_scene import R2SEGO_OT_new_scene
from .new_scene_from_files import R2SEGO_FH_captures, R2SEGO_OT_new_scene_from_files
from .open_scene import R2SEGO_FH_scene, R2SEGO_OT_open_scene
from .refine import R2SEGO_OT_refine
from .refresh_scene import R2SEGO_OT_refresh_scene
from .reset_settings import R2SEGO_OT_reset_settings
from .simplify_viewport import R2SEGO_OT_simplify_viewport

CLASSES = (
    R2SEGO_OT_new_scene,
    R2SEGO_OT_new_scene_from_files,
    R2SEGO_OT_open_scene,
    R2SEGO_OT_refresh_scene,
    R2SEGO_OT_refine,
    R2SEGO_OT_reset_settings,
    R2SEGO_OT_keep_settings,
    R2SEGO_OT_load_settings,
    R2SEGO_OT_remove_settings,
    R2SEGO_OT_simplify_viewport,
    R2SEGO_FH_scene,
    R2SEGO_FH_captures,
)
