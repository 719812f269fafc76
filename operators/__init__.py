"""The operators, a room for each sub-panel."""

import bpy

from . import asset, captures, collision, engine, generation, job, proxy, report, robot, scene, state, views

_ROOMS = (engine, scene, captures, proxy, robot, views, generation, asset, collision, report)


def register() -> None:
    """Add the whole's properties, then each room's classes and what it attaches itself."""
    state.register()
    for room in _ROOMS:
        for cls in room.CLASSES:
            bpy.utils.register_class(cls)
        if hasattr(room, "register"):
            room.register()


def unregister() -> None:
    """Let a running job go on by itself, then take everything away in reverse."""
    job.let_go()
    for room in reversed(_ROOMS):
        if hasattr(room, "unregister"):
            room.unregister()
        for cls in reversed(room.CLASSES):
            bpy.utils.unregister_class(cls)
    state.unregister()
