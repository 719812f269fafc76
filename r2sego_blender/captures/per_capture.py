"""What a step publishes for each capture: a folder with a file for every one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from ..bundle.artifacts import Artifact
from ..bundle.layout import capture_files

Each = TypeVar("Each")


class Named(Protocol):
    """A capture, by the name that its files have."""

    @property
    def name(self) -> str:
        """The photograph's name."""
        ...


@dataclass(frozen=True)
class PerCapture(Generic[Each]):
    """A published folder; its files are read when captures ask for theirs."""

    folder: Path
    load: Callable[[Path], Each]

    def of(self, captures: Sequence[Named]) -> list[Each]:
        """What was published for each capture. Raises the loader's error where a file is damaged."""
        return [self.load(self.folder / file) for file in _files(captures)]

    def found(self, captures: Sequence[Named], index: int) -> Each | None:
        """What was published for one of the captures; None where nothing was."""
        file = self.folder / _files(captures)[index]
        return self.load(file) if file.is_file() else None


def each_capture(name: str, load: Callable[[Path], Each]) -> Artifact[PerCapture[Each]]:
    """The artifact ``name`` that holds a file for each capture, as ``load`` reads one.

    A step that makes it returns ``by_file``; each value writes itself by its ``save``.
    """
    return Artifact(name, lambda folder: PerCapture(folder, load), _save)


def by_file(captures: Sequence[Named], values: Iterable[Each]) -> dict[str, Each]:
    """The captures' values by the names of their files."""
    return dict(zip(_files(captures), values, strict=True))


def _files(captures: Sequence[Named]) -> list[str]:
    return capture_files([capture.name for capture in captures])


def _save(values: Mapping[str, Any], folder: Path) -> None:
    for file, value in values.items():
        value.save(folder / file)
