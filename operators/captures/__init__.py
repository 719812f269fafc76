"""The photographs and their cameras."""

from .import_captures import R2SEGO_OT_import_captures
from .look_through import R2SEGO_OT_look_through

CLASSES = (
    R2SEGO_OT_import_captures,
    R2SEGO_OT_look_through,
)
