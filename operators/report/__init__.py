"""The report."""

from .open_report import R2SEGO_OT_open_report

CLASSES = (R2SEGO_OT_open_report,)
