"""What the panels show of the engine: whether there is one, the picture of its job, and ends of jobs."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.shared.engine_python import interpreter
from ...r2sego_blender.core.errors import R2SEgoError


class R2SEGO_PG_ended_job(bpy.types.PropertyGroup):
    """The line with which a job ended"""

    title: StringProperty()
    line: StringProperty()
    level: EnumProperty(items=[(name, name.capitalize(), "") for name in ("INFO", "WARNING", "ERROR")])


class R2SEGO_PG_backend(bpy.types.PropertyGroup):
    """What is known of a learned model"""

    why: StringProperty(description="Why it cannot be used here; empty where it can")
    licence: StringProperty(description="The licence of its weights")


class R2SEGO_PG_engine(bpy.types.PropertyGroup):
    """The engine, as this Blender knows it"""

    found: StringProperty(description="What its Python answered when it was asked last, by this Blender")
    has_python: BoolProperty(description="Whether a Python that can be run is chosen")
    picture: StringProperty(description="The latest preview picture of the running job")
    picture_icon: IntProperty(description="That picture as an icon, 0 while there is none")
    time_left: StringProperty(description="The time its task still takes, in words")
    running_for: StringProperty(description="How long the job has been running, in words")
    ended: CollectionProperty(type=R2SEGO_PG_ended_job)
    backends: CollectionProperty(type=R2SEGO_PG_backend)


def note_python() -> bool:
    """Look whether there is a Python for the engine, for the panels; returns whether that changed."""
    try:
        found = bool(interpreter())
    except R2SEgoError:
        found = False
    engine = bpy.context.window_manager.r2sego_engine
    changed = engine.has_python != found
    engine.has_python = found
    return changed
