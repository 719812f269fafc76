"""Progress of long work: bars on a terminal, JSON lines for Blender, or nothing.

Library functions take a ``Progress`` argument and report through it:

    with progress.task("Dense stereo", total=6) as task:
        for capture in captures:
            ...
            task.advance()

Work is cancelled by a signal to its process (SIGINT, or Ctrl-C); since every result is
published by a rename, nothing half-written stays behind.
"""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from .printable import printable

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")

JOB_FOLDER_VARIABLE = "R2SEGO_JOB_FOLDER"
"""Names the folder of the job this process runs for."""

_PICTURE_PAUSE_S, _PICTURE_WIDTH_PX = 2.0, 320
_LOG_PAUSE_S = 60.0


class Task:
    """One long step's progress; ``advance`` after each unit of work."""

    def __init__(self, title: str, total: int) -> None:
        self.title = title
        self.total = total
        self.done = 0

    def advance(self, units: int = 1) -> None:
        """Say that ``units`` more of ``total`` are done."""
        self.done += units


class Progress:
    """The silent progress, and the interface of the others."""

    @contextmanager
    def task(self, title: str, total: int) -> Iterator[Task]:
        """A task of ``total`` units, shown from entry to exit."""
        yield Task(title, total)

    def track(self, items: Iterable[T], title: str, total: int | None = None) -> Iterator[T]:
        """Iterate over ``items`` as a task with one unit each."""
        if total is None:
            items = list(items)
            total = len(items)
        with self.task(title, total) as task:
            for item in items:
                yield item
                task.advance()

    def message(self, text: str, level: str = "info") -> None:
        """Tell the person one line; ``level`` is ``info`` or ``warning``."""

    def picture(self, title: str, make: Callable[[], np.ndarray]) -> None:
        """Show how far the work is: ``make`` returns (H, W, 3) sRGB, float [0, 1] or uint8.

        It is called only where somebody can see the picture, and not too often.
        """


SILENT = Progress()


class SideBySide(Progress):
    """What works tell that run in threads beside each other: units of all their tasks are units of one ``task``."""

    def __init__(self, task: Task, progress: Progress) -> None:
        self._task, self._progress, self._telling = task, progress, threading.Lock()

    @contextmanager
    def task(self, title: str, total: int) -> Iterator[Task]:
        yield _BarTask(title, total, self._advance)

    def message(self, text: str, level: str = "info") -> None:
        with self._telling:
            self._progress.message(text, level)

    def picture(self, title: str, make: Callable[[], np.ndarray]) -> None:
        with self._telling:
            self._progress.picture(title, make)

    def _advance(self, units: int) -> None:
        with self._telling:
            self._task.advance(units)


class TerminalProgress(Progress):
    """Bars and messages on a terminal (``rich``); in a pipe or a log, lines as long as they are."""

    def __init__(self) -> None:
        from rich.console import Console

        # Texts name files, whose brackets are no markup.
        self._console = Console(stderr=True, highlight=False, markup=False)
        # FORCE_COLOR alone makes no terminal for bars.
        self._shown = self._console.is_terminal and sys.stderr.isatty()

    @contextmanager
    def task(self, title: str, total: int) -> Iterator[Task]:
        with (self._bar if self._shown else self._lines)(title, total) as task:
            yield task

    @contextmanager
    def _bar(self, title: str, total: int) -> Iterator[Task]:
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars

        columns = (
            TextColumn("{task.description:<34}", markup=False),
            BarColumn(bar_width=28),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Bars(*columns, console=self._console) as bars:
            bar = bars.add_task(printable(title), total=total)
            yield _BarTask(title, total, lambda units: bars.advance(bar, units))

    @contextmanager
    def _lines(self, title: str, total: int) -> Iterator[Task]:
        """A line at the end, and one a minute until then: a log says that the work goes on."""
        started_s = told_s = time.monotonic()

        def tell() -> None:
            nonlocal told_s
            told_s = time.monotonic()
            self._print(f"{title}: {task.done}/{total} in {told_s - started_s:.1f} s")

        def advanced(_units: int) -> None:
            if time.monotonic() - told_s >= _LOG_PAUSE_S:
                tell()

        task = _BarTask(title, total, advanced)
        yield task
        tell()

    def message(self, text: str, level: str = "info") -> None:
        style = "yellow" if level == "warning" else None
        self._print(f"{'warning: ' if level == 'warning' else ''}{text}", style)

    def _print(self, text: str, style: str | None = None) -> None:
        self._console.print(printable(text), style=style, soft_wrap=not self._shown)


class _BarTask(Task):
    def __init__(self, title: str, total: int, on_advance: Callable[[int], object]) -> None:
        super().__init__(title, total)
        self._on_advance = on_advance

    def advance(self, units: int = 1) -> None:
        super().advance(units)
        self._on_advance(units)


def _finite(value: Any) -> Any:
    """A JSON value with null for numbers that are infinite or none."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class JsonProgress(Progress):
    """One JSON object a line: what Blender's panel and other programs read.

    ``{"event": "progress", "task", "done", "total", "elapsed_s", "remaining_s"}`` at most
    five times a second, and ``{"event": "message", "level", "text"}``. A job (``workers/jobs.py``)
    that names its folder in ``JOB_FOLDER_VARIABLE`` also gets ``{"event": "picture", "title",
    "file"}`` at most every two seconds, for a PNG in that folder, which the next one replaces.
    """

    def __init__(self, stream: TextIO = sys.stdout) -> None:
        self._stream = stream
        self._pictured_s = -math.inf

    def emit(self, **event: Any) -> None:
        """Write one event as a line, at once; numbers that are none are null, as JSON has it."""
        self._stream.write(json.dumps(_finite(event)) + "\n")
        self._stream.flush()

    def emit_error(self, error: Exception) -> None:
        """Write what ended the work: ``{"event": "error", "kind", "text"}``."""
        self.emit(event="error", kind=type(error).__name__, text=str(error))

    @contextmanager
    def task(self, title: str, total: int) -> Iterator[Task]:
        started_s = time.monotonic()
        last_s = [0.0]
        task = _BarTask(title, total, lambda _: tell(force=False))

        def tell(force: bool) -> None:
            now_s = time.monotonic()
            if not force and now_s - last_s[0] < 0.2:
                return
            last_s[0] = now_s
            elapsed_s = now_s - started_s
            remaining_s = elapsed_s / task.done * (total - task.done) if task.done else None
            self.emit(
                event="progress",
                task=title,
                done=task.done,
                total=total,
                elapsed_s=round(elapsed_s, 2),
                remaining_s=None if remaining_s is None else round(remaining_s, 2),
            )

        tell(force=True)
        yield task
        tell(force=True)

    def message(self, text: str, level: str = "info") -> None:
        self.emit(event="message", level=level, text=text)

    def picture(self, title: str, make: Callable[[], np.ndarray]) -> None:
        folder = os.environ.get(JOB_FOLDER_VARIABLE, "")
        if not folder or time.monotonic() - self._pictured_s < _PICTURE_PAUSE_S:
            return
        from .images import resize, save_image

        rgb = make()
        height, width = rgb.shape[:2]
        scale = min(1.0, _PICTURE_WIDTH_PX / width)
        small = resize(rgb, round(width * scale), max(1, round(height * scale)))
        file = Path(folder, "picture.png")
        try:
            save_image(file.with_suffix(".unfinished"), small)
            file.with_suffix(".unfinished").replace(file)
        except OSError:  # the disk is full, or the folder was taken away: no reason to end the work
            return
        self._pictured_s = time.monotonic()
        self.emit(event="picture", title=title, file=str(file))
