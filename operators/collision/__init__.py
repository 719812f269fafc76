"""The collision surface."""

from .export_collision import R2SEGO_OT_export_collision
from .show_collision import R2SEGO_OT_show_collision

CLASSES = (
    R2SEGO_OT_show_collision,
    R2SEGO_OT_export_collision,
)
