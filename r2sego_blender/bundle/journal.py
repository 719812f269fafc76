"""What was done to a scene bundle: a line of ``journal.jsonl`` for each step that ran.

A line is written once a result is in its place, and one before where it replaces another, so
that of a step that was killed between nothing is taken for made. Lines that are cut off or
damaged are passed over. This module needs only Python, so Blender reads journals with it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from pathlib import Path, PureWindowsPath
from typing import Any

from ..core.atomic_files import write_whole
from ..core.errors import SceneError
from ..core.json_files import parse_json
from ..core.printable import printable
from ..core.text_files import read_lines
from .frames import is_frame

JOURNAL = "journal.jsonl"
"""The file in the bundle."""

_MOST_BYTES, _MOST_LINES = 64 << 20, 1 << 16
"""A refinement writes some dozens of lines, of half a kilobyte each; they are read again and again."""


class Journal:
    """The journal of the bundle at ``folder``; it may not be there yet."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / JOURNAL

    def steps(self) -> list[dict[str, Any]]:
        """The records of every step run so far, oldest first."""
        return [record for record in self._records() if "step" in record]

    def inputs(self) -> dict[str, str]:
        """The digest of what each step read, by its target; without those killed while they published."""
        return self._last("inputs")

    def outputs(self) -> dict[str, str]:
        """The ``content_digest`` of each step's last result, by its target.

        Without those that are taking their places, or were killed as they did.
        """
        return self._last("output")

    def write(self, **record: Any) -> None:
        """Add a record, JSON values, and see it on the disk. Raises OSError."""
        if self.file.is_file() and self.file.stat().st_nlink > 1:  # a copy by hard links, as backups have
            write_whole(self.file, self.file.read_text(encoding="utf-8", errors="replace"))
        with self.file.open("ab+") as file:
            if file.tell() and file.seek(-1, os.SEEK_END) and file.read() != b"\n":
                file.write(b"\n")  # a cut-off line ends there
            file.write(f"{json.dumps(record)}\n".encode())
            file.flush()
            os.fsync(file.fileno())

    def _last(self, field: str) -> dict[str, str]:
        last: dict[str, str] = {}
        for record in self._records():
            last.pop(record.get("publishing", ""), None)
            if "step" in record and field in record:
                last[record["step"]] = record[field]
        return last

    def _records(self) -> list[dict[str, Any]]:
        records = []
        try:
            lines = read_lines(self.file, _MOST_BYTES, _MOST_LINES)
        except FileNotFoundError:
            return []
        except ValueError as error:
            raise SceneError(f"this is no journal: {error}", where=self.file, cure="Remove the file.") from error
        for line in lines:
            with contextlib.suppress(ValueError):
                records.append(parse_json(line))
        return [record for record in records if _is_record(record)]


def _is_record(line: Any) -> bool:
    """Whether a line is as ``Journal.write`` writes it."""
    return (
        isinstance(line, dict)
        and all(isinstance(line.get(name, ""), str) for name in ("step", "publishing", "inputs", "output"))
        and _names_a_result(line.get("step", ""))
        and _names_a_result(line.get("publishing", ""))
        and isinstance(line.get("seconds", 0.0), int | float)
        and (line.get("frame") is None or is_frame(line["frame"]))
    )


def _names_a_result(name: str) -> bool:
    """Whether a step's target is a place in a bundle, of a round by its number where it is one's."""
    parts = re.split(r"[/\\]", name)
    number = parts[1] if parts[0] == "rounds" and len(parts) > 1 else "0"
    if parts == ["rounds"] or not re.fullmatch("[0-9]{1,9}", number):
        return False
    return not PureWindowsPath(name).anchor and ".." not in parts and printable(name) == name
