"""The side bar's panels and the preferences. They name operators by their bl_idname."""

import bpy

from . import preferences, settings, sidebar

_CLASSES = (preferences.R2SEGO_AP_preferences, *sidebar.CLASSES, *settings.CLASSES)


def register() -> None:
    """Add the preferences and panels."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away again."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
