"""The room Collision: the surface a robot collides with looked at, checked, textured, exported.

Begin with ``properties.py``; each other file is an operator. May use ``bridge/collision`` and the library, no
other room.
"""

import bpy
from bpy.props import PointerProperty

from .. import state
from . import properties


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
