"""Candidate and target views."""

from .show_candidates import R2SEGO_OT_show_candidates

CLASSES = (R2SEGO_OT_show_candidates,)
