"""The collision surface: looked at, checked, textured, exported."""

import bpy
from bpy.props import PointerProperty

from .. import state
from . import properties
from .check_collision import R2SEGO_OT_check_collision
from .export_collision import R2SEGO_OT_export_collision
from .show_collision import R2SEGO_OT_show_collision
from .texture_proxy import R2SEGO_OT_texture_proxy

CLASSES = (
    *properties.CLASSES,
    R2SEGO_OT_show_collision,
    R2SEGO_OT_check_collision,
    R2SEGO_OT_texture_proxy,
    R2SEGO_OT_export_collision,
)


def register() -> None:
    """Attach the room's properties; a check is forgotten when the surface is another."""
    bpy.types.Scene.r2sego_collision = PointerProperty(type=properties.R2SEGO_PG_collision)
    state.readers[properties.CollisionFacts] = state.Reader(properties.read)
    state.followers.append(properties.follow)


def unregister() -> None:
    """Take them away again."""
    state.followers.remove(properties.follow)
    del state.readers[properties.CollisionFacts]
    del bpy.types.Scene.r2sego_collision
