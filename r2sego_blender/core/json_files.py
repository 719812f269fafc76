"""JSON from anywhere: bounded before it is parsed, and finite numbers alone.

The standard library takes NaN, infinities, whole numbers of thousands of digits and any nesting, of
which each breaks a reader later, where nobody expects it. Needs the standard library alone.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

from .errors import R2SEgoError, may_not_be_read
from .text_files import read_bytes, write_text

MOST_BYTES = 64 << 20
"""The largest file of poses, views or a glTF's description that is read, bytes."""

_MOST_TABLES = 1 << 20
"""Lists and objects in it: each takes some 60 bytes of memory for as few as three of the file."""

_MOST_NESTING = 32
_LARGEST_INTEGER = 1 << 63
_DECIMALS = 4


def write_json(file: Path, record: Any) -> None:
    """Write JSON for people, too, one value a line."""
    write_text(file, json.dumps(record, indent=1) + "\n")


def read_json(file: Path, most_bytes: int = MOST_BYTES) -> Any:
    """What a JSON file holds, UTF-8 with or without a mark before it. Raises OSError and ValueError."""
    return parse_json(read_bytes(file, most_bytes).decode("utf-8-sig"))


def given_json(file: Path, error: type[R2SEgoError], cure: str, what: str = "the file") -> Any:
    """What a JSON file that a person names holds. Raises ``error`` where it, told as ``what``, cannot be read, and
    with this ``cure`` where it is no JSON."""
    try:
        return read_json(file)
    except OSError as cause:
        raise error(f"{what} cannot be read", where=file, cure="Check the path.") from cause
    except ValueError as cause:
        raise error(f"it is not JSON: {cause}", where=file, cure=cure) from cause


def parse_json(text: str) -> Any:
    """The value of a JSON text, whose numbers are finite and fit 64 bits.

    Raises ValueError for what is no JSON, for NaN and infinities, and beyond the bounds.
    """
    tables = text.count("[") + text.count("{")
    if tables > _MOST_TABLES:
        raise ValueError(f"it has more than {_MOST_TABLES} lists and objects")
    try:
        value = json.loads(text, parse_constant=_not_finite)
    except RecursionError:
        raise ValueError(f"it is nested more than {_MOST_NESTING} levels deep") from None
    _look_over(value)
    return value


def finite_number(value: Any) -> float:
    """A number of JSON as float, which the text "nan" is none of. Raises TypeError and ValueError."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is no number")
    return number


def rounded(value: float | None) -> float | None:
    """A score as it is written: of four decimals; None for none and for what is not finite, which JSON has not."""
    return None if value is None or not math.isfinite(value) else round(float(value), _DECIMALS)


@contextlib.contextmanager
def opened_json(
    file: Path, error: type[R2SEgoError], what: str, cure: str = "Run `r2sego refine` again."
) -> Iterator[Any]:
    """What a JSON file of a bundle holds; reads it whole inside the ``with``.

    Whatever damage is met there raises ``error`` with the file's name and cure.
    """
    try:
        yield read_json(file)
    except PermissionError as cause:
        raise may_not_be_read(file, error) from cause
    except (OSError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as cause:
        raise error(what, where=file, cure=cure) from cause


def _not_finite(word: str) -> NoReturn:
    raise ValueError(f"it holds {word}, which is no finite number")


def _look_over(value: Any) -> None:
    """Raises ValueError for numbers beyond what a reader may take for granted, and for deep nesting."""
    level = [value]
    for _ in range(_MOST_NESTING + 1):
        below: list[Any] = []
        for one in level:
            kind = type(one)
            if kind is list:
                below += one
            elif kind is dict:
                below += one.values()
                below += one
            elif kind is float:
                if not math.isfinite(one):
                    raise ValueError("it holds a number beyond all bounds")
            elif kind is int:
                if abs(one) >= _LARGEST_INTEGER:
                    raise ValueError("it holds a whole number of more than 64 bits")
            elif kind is str and not one.isascii():
                one.encode("utf-8")  # half a character of two names no file and cannot be printed
        if not below:
            return
        level = below
    raise ValueError(f"it is nested more than {_MOST_NESTING} levels deep")
