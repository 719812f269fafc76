"""Typed artifacts: what a bundle holds under a name, with its loader and its writer.

Each is declared once, in the module of what it holds, and read by all through ``Scene.read``:
by the steps of Algorithm 1, by reports, and in Blender.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from .layout import of_round

Held = TypeVar("Held", covariant=True)


@dataclass(frozen=True)
class Artifact(Generic[Held]):
    """Something that a bundle holds.

    ``name`` is its place in the bundle, a folder when it has no suffix; ``load`` reads it there, and
    raises an R2SEgoError where it is damaged. ``save`` writes it at a place; without it the step that
    makes it writes by itself. ``part_of`` names the artifact that it is published with. What is
    ``editable`` may be changed by a person as long as ``check``, or else ``load``, reads it; any other
    change of a published result is damage.
    """

    name: str
    load: Callable[[Path], Held]
    save: Callable[[Any, Path], None] | None = None
    check: Callable[[Path], object] | None = None
    part_of: str = ""
    editable: bool = True

    def of_round(self, index: int) -> Artifact[Held]:
        """The artifact of this kind that round ``index`` publishes."""
        return replace(self, name=of_round(index, self.name))

    @property
    def key(self) -> str:
        """What a step that takes it depends on, by name."""
        return self.part_of or self.name


def file_at(path: str | Path) -> Artifact[Path]:
    """A file or folder that a person gave: its content counts for a step, which opens it by its path."""
    return Artifact(str(path), load=lambda place: place)
