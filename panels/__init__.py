"""The side bar's panels, the overlays and the preferences. They name operators by their bl_idname."""

import bpy

from . import (
    asset,
    captures,
    collision,
    engine,
    generation,
    preferences,
    proxy,
    report,
    robot,
    scene,
    settings,
    sidebar,
    views,
)

_PARTS = (
    preferences, sidebar, engine, scene, settings, captures, proxy, robot, views, generation, asset,
    collision, report,
)  # fmt: skip


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
