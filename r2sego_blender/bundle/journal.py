"""What was done to a scene bundle: a line of ``journal.jsonl`` for each step that ran.

A line is written once a result is in its place, and one before where it replaces another, so
that of a step that was killed between nothing is taken for made. Lines that are cut off or
damaged are passed over. This module needs only Python, so Blender reads journals with it.
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from .frames import is_frame

JOURNAL = "journal.jsonl"
"""The file in the bundle."""


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
        with contextlib.suppress(FileNotFoundError):
            for line in self.file.read_text(encoding="utf-8", errors="replace").splitlines():
                with contextlib.suppress(json.JSONDecodeError):
                    records.append(json.loads(line))
        return [record for record in records if _is_record(record)]


def _is_record(line: Any) -> bool:
    """Whether a line is as ``Journal.write`` writes it."""
    return (
        isinstance(line, dict)
        and all(isinstance(line.get(name, ""), str) for name in ("step", "publishing", "inputs", "output"))
        and isinstance(line.get("seconds", 0.0), int | float)
        and (line.get("frame") is None or is_frame(line["frame"]))
    )
