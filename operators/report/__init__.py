"""The report."""

from .. import state
from . import properties
from .open_report import R2SEGO_OT_open_report

CLASSES = (*properties.CLASSES, R2SEGO_OT_open_report)


def register():
    """Attach the properties, and read the figures of every opened bundle."""
    properties.attach()
    state.listeners.append(properties.read_report)


def unregister():
    """Take them away."""
    state.listeners.remove(properties.read_report)
    properties.detach()
