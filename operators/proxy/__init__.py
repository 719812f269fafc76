"""The geometry proxy: looked at and mended."""

from .show_proxy import R2SEGO_OT_show_proxy

CLASSES = (R2SEGO_OT_show_proxy,)
