"""The one command of the engine that Blender follows at a time."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import Any

import bpy

from ..errors import SceneError
from ..workers.engine import Engine, Event, find_interpreter

ADDON_ID = "r2sego"

_current: Engine | None = None


def interpreter() -> str:
    """The engine's Python: the preference, else $R2SEGO_PYTHON, else pip bpy's own Python.

    Raises MachineError when there is none: Blender's own Python is never taken.
    """
    preferences = addon_preferences()
    preferred = bpy.path.abspath(preferences.engine_python) if preferences else ""
    return find_interpreter(preferred, fallback=sys.executable if bpy.app.module else "")


def addon_preferences() -> bpy.types.AddonPreferences | None:
    """This add-on's preferences, None while it is not enabled (a script on a checkout)."""
    addons = bpy.context.preferences.addons
    return next((a.preferences for a in addons if a.module.rpartition(".")[2] == ADDON_ID), None)


def is_running() -> bool:
    """Whether a command is being followed."""
    return _current is not None


def start(arguments: Iterable[str], title: str) -> Engine:
    """Start a command and show it as the running job.

    Raises SceneError when one is running, MachineError when the engine cannot start.
    """
    global _current
    if _current is not None:
        raise SceneError("the engine is busy", cure="Wait until it has ended, or cancel it.")
    _current = Engine(arguments, interpreter())
    job = bpy.context.window_manager.r2sego_job
    job.running, job.cancel_requested = True, False
    job.title, job.task, job.message = title, "Starting", ""
    job.fraction, job.remaining_s = 0.0, -1.0
    return _current


def show_event(event: Event) -> None:
    """Take one event of the engine over into the job's properties."""
    job = bpy.context.window_manager.r2sego_job
    if event.kind == "progress":
        data: Mapping[str, Any] = event.data
        job.task = str(data.get("task", ""))
        job.fraction = data.get("done", 0) / max(1, data.get("total", 1))
        remaining_s = data.get("remaining_s")
        job.remaining_s = -1.0 if remaining_s is None else remaining_s
    elif event.kind == "message":
        job.message = str(event.data.get("text", ""))


def progress_text() -> str:
    """The job in one line, for the status bar and the panel."""
    job = bpy.context.window_manager.r2sego_job
    left = f", {_duration(job.remaining_s)} left" if job.remaining_s >= 0.0 else ""
    return f"{job.task} {job.fraction:.0%}{left}"


def end() -> None:
    """Forget the ended command; one that still runs is stopped."""
    global _current
    if _current is not None:
        _current.stop()
    _current = None
    bpy.context.window_manager.r2sego_job.running = False


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
