"""What lies under the mouse: a point of the floor, or the object a person means."""

from __future__ import annotations

import json

import bpy
from mathutils import Vector

from ..proxy.placement_objects import prior_name
from ..proxy.show_proxy import shown_proxies
from ..shared.moved_bundle import BUNDLE_MARK

_MOST_HITS = 100
_BEHIND_M = 1e-4  # of what was met, the ray goes on


def floor_point(origin: Vector, direction: Vector, floor_z_m: float = 0.0) -> tuple[float, float] | None:
    """Where a ray meets the floor, (x, y) metres; None where it never does."""
    if abs(direction.z) < 1e-9:
        return None
    distance = (floor_z_m - origin.z) / direction.z
    if distance <= 0.0:
        return None
    point = origin + distance * direction
    return point.x, point.y


def target_under(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, origin: Vector, direction: Vector) -> str:
    """The target a ray means: an object's name where it meets a shown prior, or a face of the proxy
    that is of one; else the place ``x,y`` it meets; '' for nothing. What stands before them, such as
    views and the robot, is meant only where there is nothing else."""
    other, proxies = "", shown_proxies()
    for _ in range(_MOST_HITS):
        hit, place, normal, face, shown, _ = scene.ray_cast(depsgraph, origin, direction)
        if not hit:
            break
        met = f"{place.x:.3f},{place.y:.3f}"
        if normal.dot(direction) < 0.0:  # else it is not drawn: one looks through walls into the room
            if name := _object_name(shown, depsgraph, face):
                return name
            if BUNDLE_MARK not in shown or shown.original in proxies:
                return met
        other = other or met
        origin = place + _BEHIND_M * direction
    return other


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
