"""Text files as a bundle holds them: UTF-8, their lines ended alike by every system.

A step that ran on Windows then leaves the bytes, and so the digests, that it leaves elsewhere. Needs
the standard library alone.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import R2SEgoError, may_not_be_read


def write_text(file: Path, text: str) -> None:
    """Write ``text`` as ``file``."""
    file.write_text(text, encoding="utf-8", newline="\n")


def write_json(file: Path, record: Any) -> None:
    """Write JSON for people, too, one value a line."""
    write_text(file, json.dumps(record, indent=1) + "\n")


@contextlib.contextmanager
def opened_json(
    file: Path, error: type[R2SEgoError], what: str, cure: str = "Run `r2sego refine` again."
) -> Iterator[Any]:
    """What a JSON file of a bundle holds; reads it whole inside the ``with``.

    Whatever damage is met there raises ``error`` with the file's name and cure.
    """
    try:
        yield json.loads(file.read_text(encoding="utf-8"))
    except PermissionError as cause:
        raise may_not_be_read(file, error) from cause
    except (OSError, LookupError, TypeError, ValueError, AttributeError) as cause:
        raise error(what, where=file, cure=cure) from cause
