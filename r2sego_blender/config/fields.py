"""Fields of what a person declares: each with its doc and its range or choices, said once."""

from __future__ import annotations

import dataclasses
import functools
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

Range = tuple[float, float]
"""Inclusive bounds [low, high] of what is drawn uniformly."""


def setting(
    default: Any = dataclasses.MISSING,
    doc: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
    changes_result: bool = True,
    formerly: str = "",
    added: bool = False,
    form: str = "",
    read: Callable[[Any, Path], Any] | None = None,
) -> Any:
    """A dataclass field with its doc line and its inclusive range or, for names, its choices.

    Without a default it has to be given. Where it only changes how fast or in how much memory a
    result is made, nothing is made again for it. ``formerly`` is the name it once had, which files
    still give and steps' keys keep; one that was ``added`` since is in no key where it has its
    default. ``form`` says how it is written, where its type does not;
    ``read`` makes it of a TOML value and the declaring file, where the type does not say how, and
    raises ValueError with the cure.
    """
    said = Field("", None, default, doc, low, high, tuple(choices), changes_result, formerly, added, form, read)
    return dataclasses.field(default=default, metadata=vars(said))


@dataclass(frozen=True)
class Field:
    """A declared field: its ``key`` in its file, dotted or not, its type and what ``setting`` said."""

    key: str
    kind: Any
    default: Any
    doc: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    changes_result: bool = True
    formerly: str = ""
    added: bool = False
    form: str = ""
    read: Callable[[Any, Path], Any] | None = None


def fields_of(declared: type) -> Mapping[str, Field]:
    """The fields of a dataclass by their names, in their order."""
    return _fields_of(declared)


@functools.cache
def _fields_of(declared: type) -> Mapping[str, Field]:
    kinds = typing.get_type_hints(declared)
    found = {}
    for one in dataclasses.fields(declared):
        made = one.default_factory
        default = made() if made is not dataclasses.MISSING else one.default
        # A class made at run time cannot be named as a type.
        kind = type(default) if dataclasses.is_dataclass(default) else kinds[one.name]
        found[one.name] = Field(**{**one.metadata, "key": one.name, "kind": kind, "default": default})
    return MappingProxyType(found)


def in_keys(declared: Any) -> dict[str, Any]:
    """What the keys of steps hold of a dataclass: the names that fields had when keys were first made.

    Fields that change no result are left out, and those added since that have their default.
    """
    return {
        field.metadata.get("formerly") or field.name: getattr(declared, field.name)
        for field in dataclasses.fields(declared)
        if field.metadata.get("changes_result", True)
        and not (field.metadata.get("added") and getattr(declared, field.name) == field.default)
    }
