"""The index of a study's records: appended to, never changed; no number is used twice.

A line as a record begins and one as it is judged; a later judgement, as a person's from a video, is one more
line, and the last one counts. A record that began and was never judged was cut off. Standard library alone.
"""

from __future__ import annotations

import datetime
import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...core.appended_lines import append_line
from ...core.errors import TrialError
from ...core.json_files import parse_json
from ...core.text_files import read_lines
from ..outcome import Judgement, Outcome, Unusable
from .judgement_values import judgement_of, judgement_values

RECORDS_FOLDER = "records"
"""In a study's folder."""

INDEX_FILE = "index.jsonl"
"""In the folder of records."""

_NAME = re.compile(r"([0-9]{4,9})\.mcap")
_MOST_BYTES, _MOST_RECORDS, _MOST_LINES, _LONGEST = 16 << 20, 1_000_000, 100, 100
_MOST_LINES_IN_ALL = 1 << 16  # a record has three


@dataclass(frozen=True)
class Entry:
    """One record: its ``number``, the planned ``trial`` (its index, from 0) and the digest of the ``plan``.

    ``tethered`` is whether the tether stayed on, ``began`` a date and time, UTC, ``simulated`` whether no real
    device was there. ``sensors`` is the
    judgement as the record ended, None where it was cut off; ``judgement`` the one that counts: unusable for a
    record that was cut off. ``sha256`` is the finished file's, "" without one.
    """

    number: int
    trial: int
    plan: str
    tethered: bool
    began: str
    simulated: bool
    sensors: Judgement | None
    judgement: Judgement
    sha256: str

    @property
    def name(self) -> str:
        """The record's file, in the folder of records."""
        return file_name(self.number)

    @property
    def ended(self) -> tuple[int, bool, Outcome]:
        """The trial, whether it was tethered and what counts, as the plan's order asks for it."""
        return self.trial, self.tethered, self.judgement.outcome


CUT_OFF = Judgement(
    Outcome.UNUSABLE, ((Unusable.CUT_OFF, "the program that recorded it ended"),), float("nan"), float("nan")
)
"""How a record counts that began and never ended."""


def file_name(number: int) -> str:
    """The file of the record with this number."""
    return f"{number:04d}.mcap"


class RecordIndex:
    """The index of the study in ``study``; its folder of records may not be there yet."""

    def __init__(self, study: Path) -> None:
        self.folder = study / RECORDS_FOLDER
        self.file = self.folder / INDEX_FILE

    def entries(self) -> list[Entry]:
        """Every record by its number; lines that are damaged or cut off are passed over.

        Raises TrialError for a file that is none of an index, or far too large.
        """
        found: dict[int, Entry] = {}
        lines: Counter[int] = Counter()
        for line in self._lines():
            try:
                values = parse_json(line)
                number = _whole(values["record"])
                if "began" in values:
                    found.setdefault(number, _began(number, values))
                elif number in found and lines[number] < _MOST_LINES:
                    lines[number] += 1
                    found[number] = _more(found[number], values)
            except (ValueError, LookupError, TypeError):
                continue
        return [found[number] for number in sorted(found)]

    def begin(self, trial: int, plan: str, tethered: bool, simulated: bool) -> int:
        """The number of a new record, which no record has had; it is in the index before its file is made.

        One session at a time may call it. Raises OSError and TrialError.
        """
        self.folder.mkdir(exist_ok=True)
        number = 1 + max(self._numbers(), default=0)
        if number > _MOST_RECORDS:
            raise TrialError("a study holds no more records", where=self.folder, cure="Plan another study.")
        self._append(record=number, began=_now(), trial=trial, plan=plan, tethered=tethered, simulated=simulated)
        return number

    def judge(self, number: int, judgement: Judgement) -> None:
        """Add a record's judgement, the sensors' first. Raises OSError."""
        self._append(record=number, judged=_now(), judgement=judgement_values(judgement))

    def close(self, number: int, sha256: str) -> None:
        """Add the digest of a record's finished file. Raises OSError."""
        self._append(record=number, closed=_now(), sha256=sha256)

    def _append(self, **values: Any) -> None:
        append_line(self.file, json.dumps(values, allow_nan=False), to_disk=True)

    def _lines(self) -> list[str]:
        try:
            return read_lines(self.file, _MOST_BYTES, _MOST_LINES_IN_ALL)
        except FileNotFoundError:
            return []
        except (OSError, ValueError) as error:
            raise TrialError(
                f"this index of records cannot be read: {error}", where=self.file, cure="Restore it from a copy."
            ) from error

    def _numbers(self) -> set[int]:
        """All that are taken: by a line, even a damaged one, or by a file."""
        lines = {int(found[1]) for line in self._lines() if (found := re.match(r'\{"record": ([0-9]{1,9}),', line))}
        names = {int(found[1]) for file in self.folder.iterdir() if (found := _NAME.fullmatch(file.name))}
        return lines | names


def _began(number: int, values: Mapping[str, Any]) -> Entry:
    began, plan = values["began"], values["plan"]
    if not (isinstance(began, str) and isinstance(plan, str) and max(len(began), len(plan)) <= _LONGEST):
        raise ValueError("it says no date or plan")
    tethered, simulated = (values[name] is True for name in ("tethered", "simulated"))
    return Entry(number, _whole(values["trial"]), plan, tethered, began, simulated, None, CUT_OFF, "")


def _more(entry: Entry, values: Mapping[str, Any]) -> Entry:
    """The entry with what a later line says of its record."""
    if "closed" in values:
        sha256 = values["sha256"]
        return replace(entry, sha256=sha256) if _is_digest(sha256) and not entry.sha256 else entry
    judgement = judgement_of(values["judgement"])
    if entry.sensors is None and not judgement.manual:
        return replace(entry, sensors=judgement, judgement=judgement)
    return replace(entry, judgement=judgement)


def _is_digest(text: Any) -> bool:
    return isinstance(text, str) and re.fullmatch("[0-9a-f]{64}", text) is not None


def _whole(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= _MOST_RECORDS:
        raise ValueError("it is no number of a record or trial")
    return value


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
