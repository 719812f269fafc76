"""The one command of the engine that Blender follows at a time, shown in ``wm.r2sego_job``."""

from collections.abc import Iterable

import bpy

from ..r2sego_blender.bridge.engine_python import interpreter
from ..r2sego_blender.errors import SceneError
from ..r2sego_blender.workers.engine import Engine, Event

_current: Engine | None = None


def is_running() -> bool:
    """Whether a command is being followed."""
    return _current is not None


def start(arguments: Iterable[str], title: str, python: str = "", module: str = "") -> Engine:
    """Start a command of the engine and show it as the running job.

    ``python`` and ``module`` replace the engine's interpreter and its command tree.

    Raises SceneError when one is running, MachineError when the engine cannot start.
    """
    global _current
    if _current is not None:
        raise SceneError("the engine is busy", cure="Wait until it has ended, or cancel it.")
    _current = Engine(arguments, python or interpreter(), module)
    job = bpy.context.window_manager.r2sego_job
    job.running, job.cancel_requested = True, False
    job.title, job.task, job.message = title, "Starting", ""
    job.fraction, job.remaining_s = 0.0, -1.0
    return _current


def show_event(event: Event) -> None:
    """Take one event of the engine over into the job's properties."""
    job = bpy.context.window_manager.r2sego_job
    if event.kind == "progress":
        job.task = str(event.data.get("task", ""))
        job.fraction = event.data.get("done", 0) / max(1, event.data.get("total", 1))
        remaining_s = event.data.get("remaining_s")
        job.remaining_s = -1.0 if remaining_s is None else remaining_s
    elif event.kind == "message":
        job.message = str(event.data.get("text", ""))


def progress_text() -> str:
    """The job in one line, for the status bar."""
    job = bpy.context.window_manager.r2sego_job
    left = f", {_duration(job.remaining_s)} left" if job.remaining_s >= 0.0 else ""
    return f"{job.task} {job.fraction:.0%}{left}"


def end() -> None:
    """Forget the command; one that still runs is stopped."""
    global _current
    if _current is not None:
        _current.stop()
    _current = None
    shown = bpy.context.window_manager.r2sego_job
    shown.running = shown.cancel_requested = False


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
