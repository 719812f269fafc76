"""The timer that follows the engine's job, finds jobs of a former Blender, and takes results over.

It looks five times a second while a job runs, ten times where that is live. A modal operator would do so
too, but Blender saves no backup while one runs, and a refinement takes hours.
"""

import time
import traceback
from pathlib import Path

import bpy

from ...r2sego_blender.bridge.shared.operator_properties import as_arguments
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bundle.journal import JOURNAL
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.bundle import Bundle
from ...r2sego_blender.workers.jobs import Job, find_jobs, jobs_folder
from .. import job, state
from . import pictures
from .demo_scene import open_begun
from .job_scene import in_scene, scene_for, started_in
from .properties import note_python

_TICK_S, _LIVE_TICK_S, _IDLE_S = 0.2, 0.1, 0.5
_SETTLED_S = 1.0  # after a command's last step its end is near, and shows it in one step to undo
_journal_seen: tuple[str, int] | None = None
_given_up: set[Path] = set()  # folders of jobs that could not be followed
_opened_for: set[Path] = set()  # folders of jobs whose bundle was opened while they ran
_looked_in: set[str] = set()  # bundles whose jobs were looked for; "" stands for the own folder


def look_again() -> None:
    """Have jobs of a former Blender looked for."""
    _looked_in.clear()


def unfollowed_jobs(context) -> list[Job]:
    """Jobs, running or ended, that this Blender may take over: the open bundle's first.

    One whose result another running Blender takes over is left to it, unless it runs in the
    bundle that is open here too.
    """
    name = state.bundle_path(context.scene)
    folder = jobs_folder(Path(name)) if name else None
    in_bundle = [
        found for found in (find_jobs(folder) if folder else []) if found.running() or not found.followed_elsewhere
    ]
    others = [found for found in find_jobs(job.own_folder()) if not found.followed_elsewhere]
    return [found for found in in_bundle + others if found.folder not in _given_up]


def operator_of(found: Job):
    """The operator that started the job, as ``bpy.ops`` has it; None when there is none (any more)."""
    room, _, name = str(found.notes.get("operator", "")).partition(".")
    if room != "r2sego" or name not in dir(bpy.ops.r2sego):
        return None
    return getattr(bpy.ops.r2sego, name)


def take_over(found: Job) -> None:
    """Let the operator that started ``found`` wait for its end and take its result over.

    What it reports raises RuntimeError, as always in scripts.
    """
    operator, scene = operator_of(found), scene_for(found)
    if operator is None or scene is None:
        _tell_only(found)
        return
    given = as_arguments(operator, dict(found.notes.get("properties", {})))
    with in_scene(scene):
        operator("EXEC_DEFAULT", **given, job_folder=str(found.folder))


def _tell_only(found: Job) -> None:
    """The end of a job whose bundle or Blender scene is not open, or whose operator is gone."""
    job.let_go()
    try:
        found.result()
        bundle = job.bundle_of(found)
        line = f"{found.title} of {Path(bundle).name}: done" if bundle else f"{found.title}: done"
        if bundle and not found.notes.get("bundle"):  # it was to be opened
            line += f". Its Blender scene is gone or shows another bundle: open {bundle} with Open Scene"
        job.tell_end(found.title, "INFO", line)
    except R2SEgoError as error:
        job.tell_end(found.title, "WARNING" if found.cancelled else "ERROR", str(error))
    finally:
        found.forget()


def _tick() -> float:
    try:
        return _follow()
    except Exception:  # a timer that raises is never called again
        traceback.print_exc()
        if (followed := job.current()) is not None:
            _given_up.add(followed.folder)
            job.let_go()
            job.tell_end(followed.title, "ERROR", "Following it failed: Blender's console says why")
        return _IDLE_S


def _follow() -> float:
    """One look at the job and the bundle; returns the seconds until the next."""
    followed = job.current()
    if followed is None:
        if note_python():
            redraw_views("UI")
        followed = _next_job()
        if followed is None:
            return _IDLE_S
    job.show(followed)  # a file that was loaded since knows nothing of it
    for event in followed.events():
        job.show_event(event)
    engine = bpy.context.window_manager.r2sego_engine
    engine.running_for = _in_words(time.time() - followed.started)
    pictures.show(engine)
    if not _being_edited():
        _open_begun_bundle(followed)
        if followed.running():
            _show_finished_steps(scene_for(followed) or bpy.context.scene)
        else:
            _conclude(followed)
    _redraw()
    return _LIVE_TICK_S if job.is_live() else _TICK_S


def _open_begun_bundle(followed: Job) -> None:
    """Open the bundle that the job makes, once: what of it is there is shown while the rest is made."""
    scene = started_in(followed)
    if followed.folder in _opened_for or scene is None or scene.r2sego.bundle:
        return
    try:
        with in_scene(scene):
            open_begun(bpy.context, followed)
            if scene.r2sego.bundle:
                _opened_for.add(followed.folder)
                _push_undo("Open Scene")
    except (R2SEgoError, RuntimeError) as error:  # the job goes on all the same, and tells its end
        _opened_for.add(followed.folder)
        print(f"R2S-EGO: {error}")


def _show_finished_steps(scene: bpy.types.Scene) -> None:
    """Read the open bundle again when a step of it was finished since: results show as they come."""
    global _journal_seen
    name = state.bundle_path(scene)
    try:
        seen = (name, Path(name, JOURNAL).stat().st_mtime_ns) if name else None
    except OSError:
        return
    if seen != _journal_seen:
        if _journal_seen is not None and seen is not None and _journal_seen[0] == name:
            if time.time() < seen[1] * 1e-9 + _SETTLED_S:
                return
            _refresh(scene)
        _journal_seen = seen


def _refresh(scene: bpy.types.Scene) -> None:
    """Read the bundle again; what it shows anew is a step to undo: an undo over objects that are in
    no step of Blender's history crashes Blender."""
    before = {one.session_uid for one in bpy.data.objects}
    state.refresh(scene)
    if before != {one.session_uid for one in bpy.data.objects}:
        with in_scene(bpy.context.scene):
            _push_undo("Show Finished Steps")


def _next_job() -> Job | None:
    """A job to follow, if a new bundle or file was opened since the last look."""
    name = state.bundle_path(bpy.context.scene)
    if {"", name} <= _looked_in:
        return None
    found = unfollowed_jobs(bpy.context)
    if not found:
        _looked_in.update(("", name))
        return None
    if not found[0].followed_elsewhere:
        found[0].take_over()
    job.follow(found[0])
    return found[0]


def _conclude(ended: Job) -> None:
    job.let_go()
    if ended.followed_elsewhere or not ended.folder.exists():  # the other Blender takes it over
        _refresh(scene_for(ended) or bpy.context.scene)
        return
    try:
        _take_over_in_window(ended)
    except Exception:
        job.follow(ended)  # so that the tick gives it up, and does not find it again and again
        raise
    pictures.clear(bpy.context.window_manager.r2sego_engine)


def _take_over_in_window(ended: Job) -> None:
    """Take the result over, as one step to undo."""
    told = len(bpy.context.window_manager.r2sego_engine.ended)
    try:
        take_over(ended)
    except RuntimeError as error:
        if ended.folder.exists():  # its poll refused
            _tell_only(ended)
            _refresh(scene_for(ended) or bpy.context.scene)
        elif len(bpy.context.window_manager.r2sego_engine.ended) == told:
            job.tell_end(ended.title, "ERROR", str(error).strip().splitlines()[-1])
    with in_scene(bpy.context.scene):
        _push_undo(ended.title)


def _push_undo(message: str) -> None:
    if bpy.ops.ed.undo_push.poll():
        bpy.ops.ed.undo_push(message=message)


def _in_words(seconds: float) -> str:
    minutes = int(seconds // 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"


def _being_edited() -> bool:
    """Whether the person is in the middle of an action, whose data must not change under it."""
    running = [one for window in bpy.context.window_manager.windows for one in window.modal_operators]
    return any(one is not None and "UNDO" in one.bl_options for one in running)  # None: its add-on was disabled


def _redraw() -> None:
    redraw_views("UI")  # the side bar alone: a large scene is slow to draw
    for window in bpy.context.window_manager.windows:
        if not window.modal_operators:  # whose hints would be wiped
            with bpy.context.temp_override(window=window):
                bpy.context.workspace.status_text_set(None)  # has the status bar drawn anew


def _draw_in_status_bar(header, context) -> None:
    shown = context.window_manager.r2sego_job
    if not shown.running:
        return
    row = header.layout.row(align=True)
    row.ui_units_x = 22 if shown.of_bundle else 16
    left = context.window_manager.r2sego_engine.time_left
    text = ", ".join(filter(None, (shown.of_bundle, shown.task, left)))
    row.progress(factor=shown.fraction, text=text)
    row.operator("r2sego.cancel", text="", icon="X")


@bpy.app.handlers.persistent
def _file_loaded(_file: str) -> None:
    look_again()


def _bundle_shown(_scene: bpy.types.Scene, bundle: Bundle) -> None:
    if job.current() is None:
        _looked_in.discard(str(bundle.path))


def register() -> None:
    """Begin to look; without a window nobody would see, and timers do not run."""
    bpy.app.handlers.load_post.append(_file_loaded)
    state.followers.append(_bundle_shown)
    _looked_in.clear()
    if not bpy.app.background:
        bpy.app.timers.register(_tick, first_interval=_IDLE_S, persistent=True)
        bpy.types.STATUSBAR_HT_header.append(_draw_in_status_bar)


def unregister() -> None:
    """Look no longer; a running job goes on."""
    if not bpy.app.background:
        bpy.types.STATUSBAR_HT_header.remove(_draw_in_status_bar)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    state.followers.remove(_bundle_shown)
    bpy.app.handlers.load_post.remove(_file_loaded)
