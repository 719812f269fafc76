"""The visual asset: looked at, cleaned, scored."""

from .evaluate import R2SEGO_OT_evaluate

CLASSES = (R2SEGO_OT_evaluate,)
