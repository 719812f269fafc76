"""TOML files in which a person declares something, and those that come with the library."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from ..core.errors import RobotError


def shipped_names(folder: Path) -> tuple[str, ...]:
    """Names of the files in ``folder``, the library's own."""
    return tuple(sorted(file.stem for file in folder.glob("*.toml")))


def read_declaration(source: str | Path, shipped: Path, what: str, see: str) -> tuple[Path, dict[str, Any]]:
    """The path and the tables of a TOML file, or of one in the folder ``shipped`` by its name.

    Raises RobotError, calling it ``what`` and pointing to the page ``see``: it is not there,
    or no TOML.
    """
    names = shipped_names(shipped)
    path = shipped / f"{source}.toml" if str(source) in names else Path(source)
    try:
        return path, tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RobotError(
            f"this {what} cannot be read", where=path, cure=f"Give a TOML file or one of: {', '.join(names)}."
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RobotError(f"this {what} is no TOML: {error}", where=path, cure=f"See {see}.") from error
