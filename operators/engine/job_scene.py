"""The Blender scene that a job belongs to: its end acts there, whichever is shown by then."""

import contextlib
from collections.abc import Iterator

import bpy

from ...r2sego_blender.workers.jobs import Job
from .. import job, state


def started_in(found: Job) -> bpy.types.Scene | None:
    """The Blender scene a job was started from; the shown one for a job that concerns no scene.

    Of another Blender or file it is the scene of that name. None where it is gone, or shows another
    bundle by now.
    """
    name = found.notes.get("scene", "")
    if not name:
        return bpy.context.scene
    session_uid = job.started_from(found)
    same = (scene for scene in bpy.data.scenes if scene.session_uid == session_uid)
    scene = next(same, bpy.data.scenes.get(name))
    as_before = scene is not None and state.bundle_path(scene) == found.notes.get("open", "")
    return scene if as_before else None


def scene_for(found: Job) -> bpy.types.Scene | None:
    """Where a job's end acts: a Blender scene that shows its bundle, above all the one it was started
    from; where it makes the bundle and none shows it yet, ``started_in``. None when there is none."""
    bundle, started = job.bundle_of(found), started_in(found)
    for scene in (started, bpy.context.scene, *bpy.data.scenes):
        if bundle and scene is not None and state.bundle_path(scene) == bundle:
            return scene
    return None if found.notes.get("bundle") else started


@contextlib.contextmanager
def in_scene(scene: bpy.types.Scene) -> Iterator[None]:
    """In a Blender scene, as if a button were pressed in the first 3D view that shows it.

    Where no view does, in a window that shows it, else in the first window without a view.
    """
    windows = bpy.context.window_manager.windows
    showing = [window for window in windows if window.scene == scene]
    views = [(window, area) for window in showing for area in window.screen.areas if area.type == "VIEW_3D"]
    override, instead = {}, {}
    if views:
        override["window"], override["area"] = views[0]
        override["region"] = next(region for region in views[0][1].regions if region.type == "WINDOW")
    elif showing or len(windows):
        override["window"] = [*showing, *windows][0]
    if not showing:
        instead["scene"], instead["view_layer"] = scene, scene.view_layers[0]
    # One within the other: given together with a window, Blender takes the scene that the window shows.
    with bpy.context.temp_override(**override), bpy.context.temp_override(**instead):
        yield
