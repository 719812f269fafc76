"""One collection per bundle and part, replaced as a whole when the part is shown again."""

from __future__ import annotations

import bpy

_KEY = "r2sego"


def fresh_collection(scene: bpy.types.Scene, bundle_name: str, part: str) -> bpy.types.Collection:
    """An empty collection ``part`` below the bundle's; what it held before is removed."""
    root = _child(scene.collection, bundle_name, bundle_name)
    collection = _child(root, f"{bundle_name}/{part}", part)
    clear(collection)
    return collection


def find_collection(scene: bpy.types.Scene, bundle_name: str, part: str) -> bpy.types.Collection | None:
    """The collection of a part, if it was shown."""
    key = f"{bundle_name}/{part}"
    return next((c for c in scene.collection.children_recursive if c.get(_KEY) == key), None)


def clear(collection: bpy.types.Collection) -> None:
    """Remove the collection's objects, and their meshes and cameras when nothing else uses them."""
    for name in [o.name for o in collection.objects]:
        removed = bpy.data.objects[name]
        data = removed.data
        bpy.data.objects.remove(removed)
        if data is not None and data.users == 0:
            bpy.data.batch_remove([data])


def _child(parent: bpy.types.Collection, key: str, name: str) -> bpy.types.Collection:
    for child in parent.children:
        if child.get(_KEY) == key:
            return child
    child = bpy.data.collections.new(name)
    child[_KEY] = key
    parent.children.link(child)
    return child
