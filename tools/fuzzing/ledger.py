"""What guided searches have looked at, in all: ten minutes for each format are more than one sitting."""

from __future__ import annotations

import datetime
import subprocess
import threading
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from r2sego_blender.core.json_files import read_json, write_json

LEDGER = Path(__file__).with_name("searched.json")
_one_at_a_time = threading.Lock()


@dataclass(frozen=True)
class Searched:
    """What of a format was searched without a fault: processor seconds, inputs, the last time's day and commit."""

    seconds: int = 0
    inputs: int = 0
    date: str = ""
    commit: str = ""


def searched(file: Path = LEDGER) -> dict[str, Searched]:
    """By the format's name; the others were not searched."""
    return {name: Searched(**record) for name, record in read_json(file).items()} if file.is_file() else {}


def least_searched(names: Iterable[str], seconds: int, file: Path = LEDGER) -> dict[str, int]:
    """The formats that lack some of these seconds, and how many, those that lack the most first."""
    done = searched(file)
    lacking = {name: seconds - done.get(name, Searched()).seconds for name in names}
    return {name: left for name, left in sorted(lacking.items(), key=lambda one: -one[1]) if left > 0}


def record(name: str, seconds: int, inputs: int, file: Path = LEDGER) -> None:
    """Add a search that found nothing. A format in which a search finds something begins anew: see ``forget``."""
    with _one_at_a_time:
        done = searched(file)
        before = done.get(name, Searched())
        commit = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=LEDGER.parent, capture_output=True, text=True
        ).stdout.strip()
        today = datetime.date.today().isoformat()
        done[name] = Searched(before.seconds + seconds, before.inputs + inputs, today, commit)
        _write(done, file)


def forget(name: str, file: Path = LEDGER) -> None:
    """A fault was found: what was searched before its reader was mended tells nothing."""
    with _one_at_a_time:
        done = searched(file)
        if done.pop(name, None):
            _write(done, file)


def _write(done: dict[str, Searched], file: Path) -> None:
    write_json(file, {name: asdict(done[name]) for name in sorted(done)})
