"""What an operator does at a trial, told through a file beside the plan: Blender appends, the session reads.

Standard library alone. A line a control, in one write of at most ``MOST_BYTES``, so that two writers' lines
do not mix; what was written before a session began is not for it.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from ...core.appended_lines import append_line
from ...core.errors import TrialError
from ...core.json_files import parse_json
from ...core.text_files import opened_file

CONTROLS_FILE = "controls.jsonl"
"""The file in the study's folder."""

MOST_BYTES = 4096
"""The longest line."""

_READ_BYTES = 1 << 16


class Control(Enum):
    """What an operator does; in brackets what is told with it."""

    ARM = "arm"
    """Robot and chair stand as planned: record."""

    START = "start"
    """The policy starts."""

    END = "end"
    """The attempt is over."""

    INTERVENE = "intervene"
    """The operator helped the robot: a failure."""

    ABORT = "abort"
    """Something else went wrong: the trial is unusable [text]."""

    NOTE = "note"
    """For the record [text]."""

    VIDEO = "video"
    """A camera shows this moment, as by a clap or a lamp [text: which camera, or its file]."""

    JUDGE = "judge"
    """A person's judgement in place of the sensors' [outcome, by, text]."""

    NEXT = "next"
    """On to the next trial; after a self-test that failed, another."""

    STOP = "stop"
    """No more trials now; one that runs is unusable."""


@dataclass(frozen=True)
class Told:
    """A control, with what was told with it."""

    control: Control
    data: Mapping[str, Any]

    def text(self, name: str = "text") -> str:
        """What was told under a name, "" for nothing."""
        return str(self.data.get(name, ""))


def send(folder: Path, control: Control, **data: str) -> None:
    """Tell the session that runs the study in ``folder``. Raises TrialError: too long, or no file to write."""
    file = Path(folder, CONTROLS_FILE)
    line = json.dumps({"control": control.value, **data})
    if len(line) >= MOST_BYTES:  # ASCII
        raise TrialError(f"a control of {len(line)} bytes is too long", where=file, cure="Write a shorter note.")
    try:
        append_line(file, line)
    except OSError as error:
        raise TrialError(
            f"the session cannot be told: {error.strerror or error}", where=file, cure="May this folder be written?"
        ) from error


class Controls:
    """Those told to the session of the study in ``folder`` from now on."""

    def __init__(self, folder: Path) -> None:
        self._file = Path(folder, CONTROLS_FILE)
        self._offset = 0
        with contextlib.suppress(OSError):
            self._offset = self._file.stat().st_size

    def read(self) -> list[Told]:
        """Those told since the last call, oldest first, of at most 64 KiB at once; lines that are none pass."""
        try:
            if self._file.stat().st_size == self._offset:  # asked many times a second, and hardly ever told
                return []
            with opened_file(self._file) as stream:
                self._offset = min(self._offset, stream.seek(0, os.SEEK_END))  # somebody may have emptied it
                stream.seek(self._offset)
                data = stream.read(_READ_BYTES)
        except (OSError, ValueError):
            return []
        whole, newline, rest = data.rpartition(b"\n")
        if not newline and len(data) == _READ_BYTES:
            rest = b""  # no line is as long
        self._offset += len(data) - len(rest)
        return [told for line in whole.split(b"\n") if (told := _told(line)) is not None]


def _told(line: bytes) -> Told | None:
    if len(line) > MOST_BYTES:
        return None
    with contextlib.suppress(ValueError, TypeError):
        values = parse_json(line.decode())
        if isinstance(values, dict):
            return Told(Control(values.pop("control", "")), values)
    return None
