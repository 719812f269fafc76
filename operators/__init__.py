"""The operators: a room (a folder) for each sub-panel of the tab, an operator a file.

Thin: they read properties, call the library or start a job, and report. They may use ``bridge/`` and the
library; panels call them by their names. Begin with ``base.py`` (what operators are made of), ``state.py``
(the open bundle) and ``job.py`` (the engine's job). A new operator is a new file in its room, with a class
R2SEGO_OT_...: it is found there.
"""

import importlib
import pkgutil
from types import ModuleType

import bpy

from . import (
    asset,
    captures,
    collision,
    engine,
    generation,
    job,
    proxy,
    report,
    robot,
    scene,
    state,
    trials,
    view_tool,
    views,
)

_ROOMS = (engine, scene, captures, proxy, robot, views, generation, asset, collision, report, trials)


def register() -> None:
    """Add the whole's properties, then each room's classes and what it attaches itself."""
    state.register()
    for room in _ROOMS:
        for cls in classes_of(room):
            bpy.utils.register_class(cls)
        if hasattr(room, "register"):
            room.register()


def unregister() -> None:
    """Let a running job go on by itself, end tools of the mouse, then take everything away in reverse."""
    job.let_go()
    view_tool.leave_tools()
    for room in reversed(_ROOMS):
        if hasattr(room, "unregister"):
            room.unregister()
        for cls in reversed(classes_of(room)):
            bpy.utils.unregister_class(cls)
    state.unregister()


def classes_of(room: ModuleType) -> list[type]:
    """The classes that a room's files define for Blender, named R2SEGO_...: property groups first, each
    after those it is made of, as Blender wants them registered."""
    names = [f"{room.__name__}.{one.name}" for one in pkgutil.iter_modules(room.__path__)]
    found = [
        cls
        for module in (*map(importlib.import_module, names), room)
        for name, cls in vars(module).items()
        if name.startswith("R2SEGO_") and cls.__module__ == module.__name__
    ]
    return sorted(found, key=lambda cls: not issubclass(cls, bpy.types.PropertyGroup))
