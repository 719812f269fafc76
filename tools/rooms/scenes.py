"""The rooms in Blender: the demo's, and those of files with a mesh and its textures. Needs pip's ``bpy``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from demo.living_room.architecture import EAST_M, NORTH_M
from demo.make_room import build_room  # before make_truth, which finds the demo's files by it
from demo.make_truth import true_surface

from .folder import TrueRoom


@dataclass(frozen=True)
class Scene:
    """A room that stands in Blender; ``low``, ``high`` (2,) metres are the corners of the floor that is the room's."""

    truth: TrueRoom
    low: np.ndarray
    high: np.ndarray


def demo() -> Scene:
    """The demo's living room."""
    build_room()
    half = np.array([EAST_M, NORTH_M])
    return _standing(-half, half)


def hotel(folder: Path) -> Scene:
    """The bedroom of ``hotel_room.glb``: one textured mesh, whose ceiling is 2.1 m high."""
    _import(folder / "hotel_room.glb")
    for x, y in ((-1.4, 1.2), (1.4, 1.2), (-1.4, -1.2), (1.4, -1.2), (-1.5, -3.6), (1.0, -5.5)):
        _lamp((x, y, 1.95), 26.0)
    _daylight(0.35)
    return _standing(np.array([-3.2, -2.75]), np.array([3.2, 2.6]))


def house(folder: Path) -> Scene:
    """The kitchen and dining room of ``aws_small_house.glb``, under a ceiling of its own."""
    _import(folder / "aws_small_house.glb")
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(0.0, 0.0, 2.95))
    bpy.context.object.scale = (19.0, 11.4, 1.0)
    bpy.context.object.name = "ceiling"
    for x in (-6.0, 1.2, 5.9, 8.0):
        for y in (-3.6, -0.9, 1.6):
            _lamp((x, y, 2.8), 45.0)
    _daylight(0.8)
    return _standing(np.array([4.75, -5.45]), np.array([9.35, 3.1]))


ROOMS: dict[str, Callable[[Path], Scene]] = {"demo": lambda _: demo(), "hotel": hotel, "house": house}
"""Room -> what builds it, given the folder of the files with meshes."""


def standing_surface() -> TrueRoom:
    """What stands in Blender's scene now."""
    return TrueRoom(*true_surface())


def _standing(low: np.ndarray, high: np.ndarray) -> Scene:
    return Scene(standing_surface(), low, high)


def _import(file: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(file))


def _lamp(place: tuple[float, float, float], watts: float) -> None:
    data = bpy.data.lights.new("lamp", "AREA")
    data.shape, data.size, data.energy, data.color = "DISK", 0.6, watts, (1.0, 0.92, 0.82)
    lamp = bpy.data.objects.new("lamp", data)
    lamp.location, lamp.visible_camera = place, False
    bpy.context.scene.collection.objects.link(lamp)


def _daylight(strength: float) -> None:
    world = bpy.data.worlds.new("daylight")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.85, 0.92, 1.0, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = strength
    bpy.context.scene.world = world
