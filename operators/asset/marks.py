"""The marked splats: regions of space, and which of the shown splats lie in them."""

import json

import bpy
import numpy as np

from ...r2sego_blender.bridge.asset.show_asset import centres_of, set_marked
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import AssetError
from ...r2sego_blender.core.formatting import counted
from ...r2sego_blender.splats.regions import Region, region_of


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
    group = scene.r2sego_asset
    if group.shown is None or group.shown.mode == "EDIT":  # whose attributes cannot be written
        return
    centres = world_centres(group.shown)
    marked = np.zeros(len(centres), bool)
    for region in regions(scene):
        marked |= region.holds(centres)
    set_marked(group.shown.data, marked)
    group.marked = int(marked.sum())
    redraw_views("WINDOW")


@bpy.app.handlers.persistent
def undone(*_: object) -> None:
    """Undo brings back the marks of what was deleted since."""
    for scene in bpy.data.scenes:
        if scene.library is None:
            drop_marks(scene)


def drop_marks(scene: bpy.types.Scene) -> None:
    """Mark no longer the regions that the bundle's deletions have."""
    marks = scene.r2sego_asset.marks
    deleted = [region for edit in scene.r2sego_asset.edits for region in edit.described] if marks else []
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
