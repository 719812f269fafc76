"""Names that are folders' and files' on any system."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path

_PORTS = {f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10)}
_DEVICES = {"con", "prn", "aux", "nul"} | _PORTS
"""What no file of Windows can be called, whatever its suffix."""


def plain_name(name: str) -> str:
    """A name that is a file's on any system."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", name).strip("._") or "object"
    return f"object_{plain}" if plain.partition(".")[0].lower() in _DEVICES else plain


def caseless(name: str) -> str:
    """The name as it is compared with others that may be of other case, or of Unicode's decomposed form."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def by_stem(files: Iterable[Path]) -> dict[str, list[Path]]:
    """The files by their ``caseless`` stems, in their order."""
    found: dict[str, list[Path]] = {}
    for file in files:
        found.setdefault(caseless(file.stem), []).append(file)
    return found
