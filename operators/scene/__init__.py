"""The scene bundle and its refinement."""

from .new_scene import R2SEGO_OT_new_scene
from .open_scene import R2SEGO_OT_open_scene
from .refine import R2SEGO_OT_refine
from .refresh_scene import R2SEGO_OT_refresh_scene
from .reset_settings import R2SEGO_OT_reset_settings

CLASSES = (
    R2SEGO_OT_new_scene,
    R2SEGO_OT_open_scene,
    R2SEGO_OT_refresh_scene,
    R2SEGO_OT_refine,
    R2SEGO_OT_reset_settings,
)
