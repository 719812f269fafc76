"""The light: a low afternoon sun, sky through both windows, lamps and a soft fill."""

from __future__ import annotations

from math import radians

import bpy
from mathutils import Vector

from .architecture import EAST_M, NORTH_M

WARM = (1.0, 0.78, 0.55)
SUNLIGHT = (1.0, 0.83, 0.64)
SKYLIGHT = (0.86, 0.93, 1.0)


def add_lights() -> None:
    """All lights of the room and the sky outside."""
    add_sun(strength=7.5, heading_deg=14.0, elevation_deg=33.0)
    add_area("south sky", (-0.2, -NORTH_M - 0.2, 1.5), (0, 1, -0.12), (2.5, 1.4), 48.0, SKYLIGHT)
    add_area("west sky", (-EAST_M - 0.3, 0.2, 1.55), (1, 0, -0.05), (1.5, 1.35), 42.0, (1.0, 0.93, 0.82))
    add_area("ceiling fill", (-0.1, -0.1, 2.5), (0, 0, -1), (3.0, 2.4), 17.0, (1.0, 0.92, 0.82))
    add_bulb("floor lamp bulb", (0.78, NORTH_M - 0.32, 1.46), 14.0)
    add_bulb("table lamp bulb", (EAST_M - 0.24, 1.05, 1.04), 6.0)
    add_sky(strength=0.8)


def _link(name: str, data: bpy.types.Light, place) -> bpy.types.Object:
    light = bpy.data.objects.new(name, data)
    light.location = place
    light.visible_camera = False
    bpy.context.scene.collection.objects.link(light)
    return light


def add_sun(strength: float, heading_deg: float, elevation_deg: float) -> None:
    """Sunlight that travels north, ``heading_deg`` towards the east, falling at ``elevation_deg``."""
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.color, data.angle = strength, SUNLIGHT, radians(1.2)
    sun = _link("sun", data, (0, -6, 5))
    sun.rotation_euler = (radians(90 - elevation_deg), 0.0, radians(-heading_deg))


def add_area(name: str, place, direction, size: tuple[float, float], watts: float, tint) -> None:
    """A rectangle that shines in a direction and is not seen itself."""
    data = bpy.data.lights.new(name, "AREA")
    data.shape, data.size, data.size_y = "RECTANGLE", *size
    data.energy, data.color = watts, tint
    light = _link(name, data, place)
    light.rotation_euler = Vector(direction).to_track_quat("-Z", "Y").to_euler()


def add_bulb(name: str, place, watts: float) -> None:
    """A warm bulb."""
    data = bpy.data.lights.new(name, "POINT")
    data.energy, data.color, data.shadow_soft_size = watts, WARM, 0.05
    _link(name, data, place)


def add_sky(strength: float) -> None:
    """A pale blue sky all around."""
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.62, 0.78, 1.0, 1.0)
    background.inputs["Strength"].default_value = strength
    bpy.context.scene.world = world
