"""The side bar's panels, a file for each room, with the overlays over the 3D view and the preferences.

They draw what stands in properties and cached facts alone, and name operators by their bl_idname. They may
use ``bridge/`` and the library. Begin with ``sidebar.py`` (what panels share) and ``fact_list.py`` (lists).
"""

import bpy

from . import (
    asset,
    captures,
    collision,
    engine,
    generation,
    policy,
    preferences,
    proxy,
    report,
    robot,
    scene,
    settings,
    sidebar,
    trials,
    views,
)

_PARTS = (
    preferences,
    sidebar,
    engine,
    scene,
    settings,
    captures,
    proxy,
    robot,
    policy,
    views,
    generation,
    asset,
    collision,
    report,
    trials,
)


def register() -> None:
    """Add each part's classes, then what it attaches itself, such as overlays."""
    for part in _PARTS:
        for cls in part.CLASSES:
            bpy.utils.register_class(cls)
        if hasattr(part, "register"):
            part.register()


def unregister() -> None:
    """Take them away again, in reverse."""
    for part in reversed(_PARTS):
        if hasattr(part, "unregister"):
            part.unregister()
        for cls in reversed(part.CLASSES):
            bpy.utils.unregister_class(cls)
