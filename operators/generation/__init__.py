"""Conditions, clips and kept frames."""

from .render_conditions import R2SEGO_OT_render_conditions

CLASSES = (R2SEGO_OT_render_conditions,)
