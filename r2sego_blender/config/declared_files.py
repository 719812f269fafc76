"""The one reader of what a person declares in TOML: settings, behaviour scopes, policies, scenes.

Tables become frozen dataclasses, whose fields say types, ranges and choices (``fields``). Every
error names the file, the field and the cure.
"""

from __future__ import annotations

import dataclasses
import difflib
import re
import sys
import tomllib
import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar

from ..core.errors import R2SEgoError
from ..core.text_files import read_text
from .fields import Field, Range, fields_of

T = TypeVar("T")

# Bounds of a file, kept before it is parsed: the parser's time grows with the square of some of them.
MOST_BYTES = 1 << 20
"""The largest file of TOML that is read, bytes."""

_MOST_NESTING = 32
_LONGEST_WORD, _MOST_WORDS = 1000, 100_000
_LARGEST_INTEGER = 1 << 63
# Text, and raw text, of many lines, which two quotes more may end, or of one. Each also matches without its end:
# looked for once more from every quote in it, an end that never comes takes time with the square of the text.
_TOKENS = re.compile(
    r'''"""(?:\\.?|[^\\])*?(?:"{3,5}|\Z)|"(?:\\.?|[^"\\\n])*"?'''
    r"""|'''.*?(?:'{3,5}|\Z)|'[^'\n]*'?"""
    r"""|[#][^\n]*|[\w+-]+|[][{}.=,\n]""",
    re.DOTALL,
)


def shipped_names(folder: Path) -> tuple[str, ...]:
    """Names of the files in ``folder``, the library's own."""
    return tuple(sorted(file.stem for file in folder.glob("*.toml")))


def did_you_mean(name: str, known: Iterable[str], otherwise: str) -> str:
    """The cure for an unknown name: the known one that it begins or resembles, else ``otherwise``."""
    known = list(known)
    close = [one for one in known if one.startswith(name)]
    close += difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"Did you mean {close[0]}?" if close else otherwise


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a file's text. Raises ValueError: no TOML, too long, or nested too deep."""
    if len(text) > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES} characters")
    depth = dots = 0
    tokens = _TOKENS.findall(text)
    for token in tokens:
        depth += (token in ("[", "{")) - (token in ("]", "}"))
        dots = dots + 1 if token == "." else 0 if token in ("=", ",", "\n") else dots
        if max(depth, dots) > _MOST_NESTING:
            raise ValueError(f"it is nested more than {_MOST_NESTING} levels deep")
        if len(token) > _LONGEST_WORD and token[0] not in "\"'#":
            raise ValueError(f"it has a word or number of more than {_LONGEST_WORD} characters")
    if len(tokens) > _MOST_WORDS:
        raise ValueError(f"it has more than {_MOST_WORDS} words, numbers and signs")
    tables = tomllib.loads(text)
    _refuse_long_integers(tables)
    return tables


@dataclass(frozen=True)
class Reader:
    """Reads tables that ``where`` declares, called ``what`` in errors of the class ``error``.

    Unknown fields are refused where it is ``strict``.
    """

    where: Path
    what: str
    error: type[R2SEgoError]
    strict: bool = True

    @staticmethod
    def of(
        source: str | Path, shipped: Path, what: str, see: str, error: type[R2SEgoError]
    ) -> tuple[Reader, dict[str, Any]]:
        """The reader and the tables of a TOML file, or of one in the folder ``shipped`` by its name.

        Raises ``error``, pointing to the page ``see``: it is not there, or no TOML.
        """
        names = shipped_names(shipped)
        reader = Reader(shipped / f"{source}.toml" if str(source) in names else Path(source), what, error)
        try:
            return reader, reader.tables(f"See {see}.")
        except OSError as failed:
            raise error(
                f"this {what} cannot be read",
                where=reader.where,
                cure=f"Give a TOML file or one of: {', '.join(names)}.",
            ) from failed

    def tables(self, cure: str) -> dict[str, Any]:
        """The tables of the file, not yet checked. Raises OSError, or the reader's error: no TOML."""
        try:
            return parse_toml(read_text(self.where, MOST_BYTES))
        except (ValueError, RecursionError) as failed:
            raise self.error(f"this {self.what} is no TOML: {failed}", where=self.where, cure=cure) from failed

    def table(self, declared: type[T], data: Any, place: str = "") -> T:
        """The dataclass ``declared`` of a table that stands at ``place`` in the file."""
        if not isinstance(data, Mapping):
            raise self.wrong(place, "is not a table", f"Write [{place}] and its fields below.")
        fields = fields_of(declared)
        given = {}
        for name, value in data.items():
            if name in fields:
                given[name] = self.value(fields[name], value, place)
            elif self.strict:
                cure = did_you_mean(name, fields, f"Known: {', '.join(fields)}.")
                raise self.wrong(_at(place, name), f"is not a field of this {self.what}", cure)
        for field in fields.values():
            if field.key not in given and field.default is dataclasses.MISSING:
                raise self.wrong(_at(place, field.key), "is missing", _form(field.kind, field))
        return declared(**given)

    def value(self, field: Field, value: Any, place: str = "") -> Any:
        """What a field of the table at ``place`` holds, as its type: checked, and in its range."""
        place = _at(place, field.key)
        if field.read is not None:
            try:
                return field.read(value, self.where)
            except ValueError as failed:
                raise self.wrong(place, f"is {_shown(value)}", str(failed)) from failed
            except (TypeError, ArithmeticError, LookupError) as failed:
                raise self.wrong(place, f"is {_shown(value)}", _form(field.kind, field)) from failed
        return self._fitted(field.kind, value, place, field)

    def wrong(self, place: str, what: str, cure: str) -> R2SEgoError:
        """The error that says ``what`` of the field at ``place``."""
        return self.error(f"{place} {what}", where=self.where, cure=cure)

    def _fitted(self, kind: Any, value: Any, place: str, field: Field) -> Any:
        origin, parts = typing.get_origin(kind), typing.get_args(kind)
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            return self.table(kind, value, place)
        if origin in (typing.Union, UnionType):
            # One that is written as a list, and one that is not; None is what is left out.
            of_kind = [part for part in parts if (typing.get_origin(part) is tuple) == isinstance(value, list)]
            kind = next(part for part in (*of_kind, *parts) if part is not NoneType)
            return self._fitted(kind, value, place, field)
        if kind == Range:
            return self._range(value, place, field)
        if origin is tuple and parts[-1] is Ellipsis and isinstance(value, list):
            each = enumerate(value)
            return tuple(self._fitted(parts[0], one, f"{place}[{index}]", field) for index, one in each)
        if kind is Any:
            return value
        if origin is tuple:
            fits = isinstance(value, list) and len(value) == len(parts) and all(map(_fits, parts, value))
        else:
            fits = _fits(origin or kind, value)
        if not fits:
            raise self.wrong(place, f"is {_shown(value)}", _form(kind, field))
        if field.choices and value not in field.choices:
            raise self.wrong(place, f"is {_shown(value)}", f"Give one of: {', '.join(field.choices)}.")
        if kind in (int, float):
            self._in_limits(value, value, place, field)
            return kind(value)
        return tuple(part(one) for part, one in zip(parts, value, strict=True)) if origin is tuple else value

    def _range(self, value: Any, place: str, field: Field) -> Range:
        if not isinstance(value, list) or len(value) != 2:
            raise self.wrong(place, f"is {_shown(value)}", "Write a range [low, high].")
        if not all(map(is_number, value)):
            raise self.wrong(place, f"is {_shown(value)}", "Write finite numbers.")
        for number in value:
            self._in_limits(number, value, place, field)
        if value[0] > value[1]:
            raise self.wrong(place, f"is {_shown(value)}", "Write the smaller number first.")
        return float(value[0]), float(value[1])

    def _in_limits(self, number: float, value: Any, place: str, field: Field) -> None:
        low, high = field.low, field.high
        if (low is not None and number < low) or (high is not None and number > high):
            named = (("from", low), ("to", high))
            limits = " ".join(f"{word} {limit:.10g}" for word, limit in named if limit is not None)
            raise self.wrong(place, f"is {_shown(value)}", f"It lies {limits}.")


def _refuse_long_integers(value: Any, place: str = "") -> None:
    """Raises ValueError for a whole number that TOML has none of, with its place: it is no float either."""
    if isinstance(value, dict):
        for name, one in value.items():
            _refuse_long_integers(one, _at(place, name))
    elif isinstance(value, list):
        for index, one in enumerate(value):
            _refuse_long_integers(one, f"{place}[{index}]")
    elif isinstance(value, int) and abs(value) >= _LARGEST_INTEGER:
        raise ValueError(f"{place} is a whole number of more than 64 bits")


def is_number(value: Any) -> bool:
    """Whether a TOML value is a finite number."""
    is_one = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_one and abs(value) <= sys.float_info.max


def is_place(value: Any) -> bool:
    """Whether a TOML value is [x, y] of finite numbers."""
    return isinstance(value, list) and len(value) == 2 and all(map(is_number, value))


def _fits(kind: Any, value: Any) -> bool:
    if kind in (int, float):
        return is_number(value) and (kind is float or value == int(value))
    return isinstance(value, kind)


def _form(kind: Any, field: Field) -> str:
    """How a field is written, as a cure."""
    if field.form or field.choices:
        return field.form or f"Give one of: {', '.join(field.choices)}."
    known: dict[Any, str] = {
        bool: "Write true or false.",
        int: "Write a whole number.",
        float: "Write a finite number.",
    }
    known |= {str: "Write a text in quotes.", Range: "Write a range [low, high]."}
    return known.get(kind, "Write a table." if dataclasses.is_dataclass(kind) else "Write a list.")


def _shown(value: Any) -> str:
    shown = repr(value)
    return shown if len(shown) <= 200 else f"{shown[:200]}..."


def _at(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name
