"""What lies under the mouse: a point of the floor, or the object a person means."""

from __future__ import annotations

import json

import bpy
from mathutils import Vector

from .placement_objects import prior_name


def floor_point(origin: Vector, direction: Vector, floor_z_m: float = 0.0) -> tuple[float, float] | None:
    """Where a ray meets the floor, (x, y) metres; None where it never does."""
    if abs(direction.z) < 1e-9:
        return None
    distance = (floor_z_m - origin.z) / direction.z
    if distance <= 0.0:
        return None
    point = origin + distance * direction
    return point.x, point.y


def target_under(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, origin: Vector, direction: Vector
) -> str:
    """The target a ray means: an object's name where it meets a shown prior, or a face of the proxy
    that is of one; else the place ``x,y`` it meets; '' for nothing."""
    hit, place, _, face, shown, _ = scene.ray_cast(depsgraph, origin, direction)
    if not hit:
        return ""
    return _object_name(shown, depsgraph, face) or f"{place.x:.3f},{place.y:.3f}"


def _object_name(shown: bpy.types.Object, depsgraph: bpy.types.Depsgraph, face: int) -> str:
    """The name of a shown prior, or of the object a drawn face of the proxy is of; '' for anything else."""
    if name := prior_name(shown):
        return name
    mesh = shown.original.data if shown.type == "MESH" else None
    if mesh is None or "instance_names" not in mesh:
        return ""
    drawn = shown.evaluated_get(depsgraph).data.attributes.get("instance")  # where fewer faces are drawn
    if drawn is None or face >= len(drawn.data):
        return ""
    instance = drawn.data[face].value
    names = json.loads(mesh["instance_names"])
    return names[instance - 1] if 1 <= instance <= len(names) else ""
