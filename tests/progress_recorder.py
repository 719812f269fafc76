"""A progress that records what it is told: every message and every task."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from r2sego_blender.core.progress import Progress, Task


class ProgressRecorder(Progress):
    """``messages`` are (level, text) pairs and ``tasks`` say how far each came, both in order."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, str]] = []
        self.tasks: list[Task] = []

    @property
    def warnings(self) -> list[str]:
        """The texts of the messages that warn."""
        return [text for level, text in self.messages if level == "warning"]

    @contextmanager
    def task(self, title: str, total: int) -> Iterator[Task]:
        task = Task(title, total)
        self.tasks.append(task)
        yield task

    def message(self, text: str, level: str = "info") -> None:
        self.messages.append((level, text))
