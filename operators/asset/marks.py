"""The marked splats: regions of space, and which of the shown splats lie in them."""

import json

import bpy
import numpy as np

from ...r2sego_blender.bridge.asset.show_asset import centres_of, set_marked
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import AssetError
from ...r2sego_blender.core.formatting import counted
from ...r2sego_blender.splats.regions import Region, region_of

_latest = 0
"""The latest revision in any scene: undo takes a scene's own back, and what is marked then is another."""


def add_mark(scene: bpy.types.Scene, region: Region) -> str:
    """Mark what a region holds of the shown splats, beside what is marked already.

    Returns one line for the person. Raises AssetError when it holds none.
    """
    group = scene.r2sego_asset
    held = int(region.holds(world_centres(group.shown)).sum())
    if not held:
        raise AssetError("no splat is there", cure="Move or enlarge the box, or the lasso's distances.")
    mark = group.marks.add()
    described = region.to_json()
    mark.region, mark.kind, mark.splats = json.dumps(described), described["kind"], held
    mark_again(scene)
    return f"{counted(held, 'splat')} marked, {group.marked} in all"


def mark_again(scene: bpy.types.Scene) -> None:
    """Find the shown splats that lie in the marked regions."""
    global _latest
    group = scene.r2sego_asset
    if group.shown is None or group.shown.mode == "EDIT":  # whose attributes cannot be written
        return
    centres = world_centres(group.shown)
    marked = np.zeros(len(centres), bool)
    for region in regions(scene):
        marked |= region.holds(centres)
    set_marked(group.shown.data, marked)
    group.marked = int(marked.sum())
    _latest = max(_latest, group.revision) + 1
    group.revision = _latest
    redraw_views("WINDOW")


def drop_marks(scene: bpy.types.Scene, deleted: list[dict]) -> None:
    """Mark no longer the regions that the bundle's deletions have: undo brings their marks back."""
    marks = scene.r2sego_asset.marks
    gone = [index for index, mark in enumerate(marks) if json.loads(mark.region) in deleted]
    for index in reversed(gone):
        marks.remove(index)
    if gone and marks:
        mark_again(scene)
    elif gone:
        clear_marks(scene)


def clear_marks(scene: bpy.types.Scene) -> None:
    """Mark nothing."""
    scene.r2sego_asset.marks.clear()
    scene.r2sego_asset.marked = 0
    mark_again(scene)


def regions(scene: bpy.types.Scene) -> list[Region]:
    """The marked regions."""
    return [region_of(json.loads(mark.region), "marks") for mark in scene.r2sego_asset.marks]


def world_centres(shown: bpy.types.Object) -> np.ndarray:
    """(N, 3) float64, the shown splats' centres in the world, metres.

    They are those of the file: moving the object moves only what is drawn.
    """
    return centres_of(shown.data).astype(np.float64)
