"""The one job of the engine that Blender follows at a time, shown in ``wm.r2sego_job``.

A job is a folder of its own and outlives this Blender; here stands only which one is
followed, and what of it is shown.
"""

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import bpy

from ..r2sego_blender.bridge.engine.user_folder import user_folder
from ..r2sego_blender.bridge.shared.engine_python import interpreter
from ..r2sego_blender.bridge.shared.operator_properties import given_properties
from ..r2sego_blender.core.errors import SceneError
from ..r2sego_blender.core.printable import printable
from ..r2sego_blender.workers.jobs import PICTURE_FILE, Event, Job, jobs_folder, start_job
from . import state

_BUNDLE_FILE = "scene.toml"
_REMEMBERED_ENDS = 4

listeners: dict[str, Callable[[Job, Mapping[str, Any]], None]] = {}
"""What a room does with events of a kind that it alone knows; it is called with the job and the event's data."""

_followed: Job | None = None
_is_live = False
_started_from: dict[Path, int] = {}  # jobs' folders; session numbers of Blender scenes


def current() -> Job | None:
    """The job that is followed, None when the engine is idle."""
    return _followed


def is_running() -> bool:
    """Whether a job is followed."""
    return _followed is not None


def is_live() -> bool:
    """Whether the followed job tells a room what goes on: it is looked at more often then."""
    return _is_live


def own_folder() -> Path:
    """Where jobs stand whose command has no bundle yet."""
    return user_folder("jobs")


def bundle_of(job: Job) -> str:
    """The bundle that a job works on, or has made; '' where there is none (yet)."""
    return job.notes.get("bundle", "") or next(filter(_is_bundle, job.command), "")


def started_from(job: Job) -> int | None:
    """The session number of the Blender scene that a job was started from, None for another Blender's."""
    return _started_from.get(job.folder)


def start(
    operator: bpy.types.Operator, arguments: Iterable[str], python: str = "", module: str = "", *, of_scene: bool = True
) -> Job:
    """Start the engine's command ``arguments`` for ``operator``, and follow it.

    It stands in the bundle it works on, where there is one. ``python`` and ``module`` replace
    the engine's interpreter and its command tree; ``of_scene`` says whether it concerns the
    Blender scene. Raises SceneError when one is running, MachineError when it cannot start.
    """
    if _followed is not None:
        raise SceneError("the engine is busy", cure="Wait until it has ended, or cancel it.")
    arguments = list(arguments)
    bundle = next(filter(_is_bundle, arguments), "")
    scene = bpy.context.scene
    notes = {
        "operator": type(operator).bl_idname,
        "properties": given_properties(operator),
        "bundle": bundle,
        "scene": scene.name if of_scene else "",
        "open": state.bundle_path(scene),
    }
    in_bundle = jobs_folder(Path(bundle)) if bundle and os.access(bundle, os.W_OK) else None
    folder = in_bundle or own_folder()
    started = start_job(arguments, python or interpreter(), operator.bl_label, folder, module, notes)
    _started_from[started.folder] = scene.session_uid
    bpy.context.window_manager.r2sego_engine.ended.clear()
    follow(started)
    return started


def follow(job: Job) -> None:
    """Show ``job`` as the running one."""
    global _followed, _is_live
    _followed, _is_live = job, False
    bpy.context.window_manager.r2sego_job.running = False
    show(job)


def of_several(bundle: str) -> str:
    """A bundle's name where the Blender scenes of this file show others beside it, else ''; with its
    folder's where one of them has the same."""
    others = {state.bundle_path(scene) for scene in bpy.data.scenes} - {"", bundle}
    path = Path(bundle)
    if not bundle or not others:
        return ""
    return f"{path.parent.name}/{path.stem}" if path.stem in {Path(one).stem for one in others} else path.stem


def show(job: Job) -> None:
    """Show ``job``, from its beginning where it is not shown yet."""
    shown = bpy.context.window_manager.r2sego_job
    shown.of_bundle = of_several(bundle_of(job))  # others are opened and closed while it runs
    if not shown.running:
        shown.running, shown.cancel_requested = True, job.cancelled
        shown.title, shown.task, shown.message = job.title, "Starting", ""
        shown.fraction = 0.0
        engine = bpy.context.window_manager.r2sego_engine
        engine.picture, engine.time_left = "", ""


def show_event(event: Event) -> None:
    """Take one event of the engine over into the job's properties, or hand it to the room that knows its kind."""
    global _is_live
    shown, data = bpy.context.window_manager.r2sego_job, event.data
    if event.kind == "progress":
        shown.task = str(data.get("task", ""))
        shown.fraction = data.get("done", 0) / max(1, data.get("total", 1))
        remaining_s = data.get("remaining_s")
        left = "" if remaining_s is None else f"{_duration(remaining_s)} left"
        bpy.context.window_manager.r2sego_engine.time_left = left
    elif event.kind == "message":
        shown.message = printable(str(data.get("text", "")))
    elif event.kind == "picture" and _followed is not None:
        bpy.context.window_manager.r2sego_engine.picture = str(_followed.folder / PICTURE_FILE)
    elif event.kind in listeners and _followed is not None:
        _is_live = True
        listeners[event.kind](_followed, data)


def cancel() -> None:
    """Ask the followed job to end, without waiting; it does within two seconds."""
    if _followed is not None:
        _followed.cancel()
        shown = bpy.context.window_manager.r2sego_job
        shown.cancel_requested, shown.task = True, "Cancelling"


def let_go() -> None:
    """Follow the job no longer; one that still runs goes on."""
    global _followed, _is_live
    _followed, _is_live = None, False
    bpy.context.window_manager.r2sego_job.running = False
    bpy.context.window_manager.r2sego_job.cancel_requested = False


def tell_end(title: str, level: str, line: str) -> None:
    """Keep the line with which a job ended until it is dismissed; ``level``: INFO, WARNING or ERROR."""
    ended = bpy.context.window_manager.r2sego_engine.ended
    end = ended.add()
    end.title, end.level, end.line = title, level, sentence(line)
    while len(ended) > _REMEMBERED_ENDS:
        ended.remove(0)


def sentence(line: str) -> str:
    """It begins with a capital; but a file's or a robot's name at its beginning stays as it is."""
    first = line.split(" ", 1)[0].rstrip(".,:;")
    return line if any(mark in first for mark in "./\\:") else line[:1].upper() + line[1:]


def _is_bundle(argument: str) -> bool:
    try:
        return argument != "" and Path(argument, _BUNDLE_FILE).is_file()
    except OSError:  # longer than any path
        return False


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
