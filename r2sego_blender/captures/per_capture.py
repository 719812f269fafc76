"""What a step publishes for each capture: a folder with a file for every one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from ..bundle.artifacts import Artifact
from ..bundle.layout import capture_files
from .capture import Capture

Each = TypeVar("Each")


@dataclass(frozen=True)
class PerCapture(Generic[Each]):
    """A published folder; its files are read when captures ask for theirs."""

    folder: Path
    load: Callable[[Path], Each]

    def of(self, captures: Sequence[Capture]) -> list[Each]:
        """What was published for each capture. Raises the loader's error where a file is damaged."""
        return [self.load(self.folder / file) for file in _files(captures)]


def each_capture(name: str, load: Callable[[Path], Each]) -> Artifact[PerCapture[Each]]:
    """The artifact ``name`` that holds a file for each capture, as ``load`` reads one.

    A step that makes it returns ``by_file``; each value writes itself by its ``save``.
    """
    return Artifact(name, lambda folder: PerCapture(folder, load), _save)


def by_file(captures: Sequence[Capture], values: Iterable[Each]) -> dict[str, Each]:
    """The captures' values by the names of their files."""
    return dict(zip(_files(captures), values, strict=True))


def _files(captures: Sequence[Capture]) -> list[str]:
    return capture_files([capture.name for capture in captures])


def _save(values: Mapping[str, Any], folder: Path) -> None:
    for file, value in values.items():
        value.save(folder / file)
