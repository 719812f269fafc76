"""One collection per bundle and part, replaced as a whole when the part is shown again.

They are known by what they carry, the bundle's path and the part: a person may rename them and
move them under other collections, and another bundle's folder may have the same name.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import bpy

from ...results.panels.bundle import SUFFIX
from .moved_bundle import BUNDLE_MARK

_PART, _MADE_AS = "r2sego_part", "r2sego_made_as"
_ROOT = ""
"""In place of a part: the collection that holds the bundle's parts."""


def fresh_collection(scene: bpy.types.Scene, bundle_path: str | Path, part: str) -> bpy.types.Collection:
    """The collection ``part`` of the bundle at ``bundle_path``; what was made for it before is removed."""
    collection = find_collection(scene, bundle_path, part)
    if collection is None:
        root = find_collection(scene, bundle_path, _ROOT)
        if root is None:
            name = Path(bundle_path).name.removesuffix(SUFFIX)
            root = _new_collection(scene.collection, name, bundle_path, _ROOT)
        collection = _new_collection(root, part, bundle_path, part)
    clear(collection)
    return collection


def find_collection(scene: bpy.types.Scene, bundle_path: str | Path, part: str) -> bpy.types.Collection | None:
    """The collection of a part of the bundle at ``bundle_path``, if it was shown.

    One that is linked from another .blend is not it: nothing can be put into that.
    """
    for collection in scene.collection.children_recursive:
        if collection.library is not None or collection.override_library is not None:
            continue
        if collection.get(_PART) == part and collection.get(BUNDLE_MARK) == str(bundle_path):
            return collection
    return None


def link(collection: bpy.types.Collection, made: bpy.types.Object) -> None:
    """Put an object that was made of the bundle into one of its collections, for ``clear`` to remove."""
    made[BUNDLE_MARK], made[_MADE_AS] = collection[BUNDLE_MARK], made.name
    collection.objects.link(made)


def clear(collection: bpy.types.Collection) -> None:
    """Remove what ``link`` put there; what a person put there stays.

    Copies of it are the person's too: they come to stand beside the collection.
    """
    ours = [one for one in collection.objects if one.get(BUNDLE_MARK) == collection[BUNDLE_MARK]]
    made = {one.get(_MADE_AS, one.name): one for one in reversed(ours)}.values()  # copies stand behind it
    for copy in set(ours).difference(made):
        _give_away(copy, collection)
    remove_objects(made)


def _give_away(copy: bpy.types.Object, collection: bpy.types.Collection) -> None:
    """Let a copy be a person's own, where it stands in the world, beside the part's ``collection``."""
    place = copy.matrix_world.copy()
    copy.parent, copy.matrix_world = None, place
    del copy[BUNDLE_MARK]
    roots = (*bpy.data.collections, *(scene.collection for scene in bpy.data.scenes))
    beside = next((one for one in roots if collection in one.children.values()), None)
    if beside is not None and copy not in beside.objects.values():
        beside.objects.link(copy)
        collection.objects.unlink(copy)


def remove_objects(removed: Iterable[bpy.types.Object]) -> None:
    """Remove objects, and their meshes, cameras and actions when nothing else uses them."""
    for one in list(removed):
        held = [one.data, one.animation_data.action if one.animation_data else None]
        bpy.data.objects.remove(one)
        remove_unused(data for data in held if data is not None)


def remove_unused(held: Iterable[bpy.types.ID]) -> None:
    """Remove those of the data-blocks that nothing uses."""
    bpy.data.batch_remove([data for data in held if data.users == 0])


def _new_collection(
    parent: bpy.types.Collection, name: str, bundle_path: str | Path, part: str
) -> bpy.types.Collection:
    collection = bpy.data.collections.new(name)
    collection[BUNDLE_MARK], collection[_PART] = str(bundle_path), part
    parent.children.link(collection)
    return collection
