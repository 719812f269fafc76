"""Text files as a bundle holds them: UTF-8, their lines ended alike by every system.

A step that ran on Windows then leaves the bytes, and so the digests, that it leaves elsewhere. Needs
the standard library alone.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


def write_text(file: Path, text: str) -> None:
    """Write ``text`` as ``file``."""
    file.write_text(text, encoding="utf-8", newline="\n")


def write_json(file: Path, record: Any) -> None:
    """Write JSON for people, too, one value a line."""
    write_text(file, json.dumps(record, indent=1) + "\n")
