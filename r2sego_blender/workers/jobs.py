"""Commands of the engine as jobs: a folder each, which outlives whoever started it.

A job's process runs in a session of its own and writes to its folder, so closing Blender
does not end it, and the next Blender finds it there and follows it:

    job.json       what runs, since when, and what the starter noted
    process.json   the supervisor's process: number and birth
    events.jsonl   the command's standard output, JSON lines among it
    stderr.txt     its standard error
    picture.png    its latest preview picture, if it made one
    cancel         there when somebody asked for the end
    follower.json  the process that follows it, where that is not its starter
    end.json       the exit status and the digest of its events, once it has ended

That folder may lie in a scene bundle, and a bundle may come from anybody: so job.json and end.json are
signed, and without this person's signature there is no job, whatever lies there. Standard library alone.
"""

from __future__ import annotations

import contextlib
import datetime
import itertools
import os
import platform
import secrets
import shutil
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.errors import MachineError, R2SEgoError, SceneError
from ..core.json_files import parse_json
from ..core.printable import printable
from ..core.progress import JOB_FOLDER_VARIABLE
from .engine import COMMAND_NAME, GOING_ON, LIBRARY, engine_environment
from .processes import birth, group_of_its_own
from .signed_records import read_record, read_signed, write_signed
from .supervisor import (
    CANCEL_FILE,
    END_FILE,
    EVENTS_FILE,
    GRACE_S,
    JOB_FILE,
    PROCESS_FILE,
    WORDS_FILE,
    digest_of_events,
    write_record,
)

JOBS_FOLDER = ".jobs"
"""Where a scene bundle keeps its jobs."""

PICTURE_FILE = "picture.png"
"""A job's latest preview picture, in its folder."""

_FORMAT = 1
_FOLLOWER_FILE = "follower.json"
_TELLS_RESULT = "--json-progress"  # a command with this option ends with a result event
_START_LIMIT_S = 30.0  # a supervisor that has not said who it is by then did not start
_TAIL_BYTES = 8192
_MOST_FOLDERS = 1000  # of jobs that are looked at: a bundle may be full of others
_READ_BYTES = 4 << 20  # at once; no line of the engine's is longer
_LARGEST_PID = 1 << 31
_started_here: set[subprocess.Popen] = set()  # so that none is left a zombie


class EngineError(R2SEgoError):
    """A command of the engine that ended without its result."""


@dataclass(frozen=True)
class Event:
    """One line of the engine: ``kind`` is progress, message, picture, result or error."""

    kind: str
    data: Mapping[str, Any]


def start_job(
    arguments: Iterable[str],
    interpreter: str,
    title: str,
    folder: Path,
    module: str = "",
    notes: Mapping[str, Any] | None = None,
) -> Job:
    """Start ``interpreter -m r2sego_blender arguments``, or another ``module`` of the library.

    The job's own folder is made in ``folder``. ``notes`` are JSON values kept with it, for
    whoever follows it later. Raises MachineError when it cannot be started.
    """
    if shutil.which(interpreter) is None:
        raise MachineError(
            "the engine could not be started: it is not there or cannot be run",
            where=interpreter,
            cure="Choose another Python in the add-on's preferences.",
        )
    name = f"{LIBRARY.name}.{module}" if module else LIBRARY.name
    now = datetime.datetime.now(datetime.UTC)
    place = Path(folder) / f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
    record = {
        "format": _FORMAT,
        "title": title,
        "command": [interpreter, "-m", name, *arguments],
        "started": now.timestamp(),
        "machine": platform.node(),
        "notes": dict(notes or {}),
        "starter": _this_process(),
    }
    try:
        place.mkdir(parents=True)
        write_signed(place / JOB_FILE, record)
        # Blender's own Python where there is one, and not the engine's, which may be broken.
        own_python = shutil.which(sys.executable or "") or interpreter
        process = subprocess.Popen(
            [own_python, "-m", f"{LIBRARY.name}.workers.supervisor", str(place)],
            env=engine_environment() | {JOB_FOLDER_VARIABLE: str(place)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **group_of_its_own(window=False),
        )
    except MachineError:
        shutil.rmtree(place, ignore_errors=True)
        raise
    except OSError as error:
        shutil.rmtree(place, ignore_errors=True)
        raise MachineError(
            f"a job could not be started: {error}",
            where=place.parent,
            cure="Is there room on the disk, and may this folder be written?",
        ) from error
    _started_here.difference_update([one for one in _started_here if one.poll() is not None])
    _started_here.add(process)
    return Job(place, record, process)


def jobs_folder(bundle: Path) -> Path | None:
    """Where a bundle keeps its jobs; None where what stands there is no folder, or leads out of it."""
    folder = bundle / JOBS_FOLDER
    return folder if not os.path.lexists(folder) or (folder.is_dir() and _in_place(folder)) else None


def find_jobs(folder: Path) -> list[Job]:
    """The jobs in ``folder``, running or ended, oldest first.

    What is damaged, is another person's, or runs on another machine that shares the disk, is passed over.
    """
    found = []
    with contextlib.suppress(OSError):
        for place in sorted(itertools.islice(Path(folder).iterdir(), _MOST_FOLDERS)):
            with contextlib.suppress(SceneError):
                job = Job.open(place)
                if job.machine == platform.node():
                    found.append(job)
    return found


class Job:
    """One command of the engine; get one from ``start_job``, ``find_jobs`` or ``Job.open``."""

    def __init__(self, folder: Path, record: Mapping[str, Any], process: subprocess.Popen | None = None) -> None:
        self.folder = folder
        self.title: str = record["title"]
        self.command: list[str] = record["command"]
        self.started: float = record["started"]
        self.machine: str = record["machine"]
        self.notes: Mapping[str, Any] = record["notes"]
        self._starter = record["starter"]
        self._process = process
        self._offset = 0
        self._unread: deque[Event] = deque()
        self._result: Mapping[str, Any] | None = None
        self._error = ""
        self._last_line = ""

    @staticmethod
    def open(folder: Path) -> Job:
        """The job of a folder. Raises SceneError unless this machine's person started it, there."""
        file = Path(folder) / JOB_FILE
        record = read_signed(file)
        if record.get("format") != _FORMAT or not _holds_files_alone(Path(folder)):
            raise SceneError(
                "this is no job that was started on this machine, in this folder", where=file, cure="Remove the folder."
            )
        return Job(Path(folder), record)

    @property
    def cancelled(self) -> bool:
        """Whether somebody asked for the end before the command had ended."""
        return (self.folder / CANCEL_FILE).exists()

    @property
    def followed_elsewhere(self) -> bool:
        """Whether another living process started it, or has taken it over with ``take_over``."""
        follower = read_record(self.folder / _FOLLOWER_FILE) or self._starter
        return follower.get("pid") != os.getpid() and _lives(follower)

    def take_over(self) -> None:
        """Note that this process follows it now."""
        with contextlib.suppress(OSError):
            write_record(self.folder / _FOLLOWER_FILE, _this_process())

    def running(self) -> bool:
        """Whether the command still runs."""
        if (self.folder / END_FILE).exists() or not self.folder.exists():
            return False
        if self._process is not None:
            return self._process.poll() is None
        process = read_record(self.folder / PROCESS_FILE)
        if process:
            return _lives(process)
        return time.time() - self.started < _START_LIMIT_S

    def events(self) -> list[Event]:
        """The events since the last call, oldest first; never waits."""
        self._read()
        events, self._unread = list(self._unread), deque()
        return events

    def cancel(self) -> None:
        """Ask for the end (SIGINT) without waiting; a command that has not ended after ``GRACE_S``
        is killed. It does not matter who started the job."""
        if self.running():
            with contextlib.suppress(OSError):
                (self.folder / CANCEL_FILE).touch()

    def stop(self) -> None:
        """Cancel and wait for the end."""
        self.cancel()
        deadline_s = time.monotonic() + 3.0 * GRACE_S
        while self.running() and time.monotonic() < deadline_s:
            time.sleep(0.02)

    def wait(self, on_event: Callable[[Event], None] = lambda event: None) -> Mapping[str, Any]:
        """Follow the command to its end and return its result; an interrupt here stops it.

        Raises EngineError as ``result`` does.
        """
        try:
            while self.running():
                for event in self.events():
                    on_event(event)
                time.sleep(0.02)
        except BaseException:
            self.stop()
            raise
        for event in self.events():
            on_event(event)
        return self.result()

    def result(self) -> Mapping[str, Any]:
        """Wait for the end and return the data of the result event, empty for a command that tells none.

        Raises EngineError with the engine's own line when it failed, was cancelled or was killed, and
        when a command that tells its result ended without one.
        """
        while self.running():
            time.sleep(0.02)
        end = self._end()
        status = end.get("status")
        if self.cancelled and status != 0:
            raise EngineError("cancelled", cure=self._way_on())
        if status is None:
            raise EngineError(
                end.get("error") or "it ended without a word: killed, or the machine went down",
                where=self.title,
                cure=self._way_on(),
            )
        if status != 0 or self._error:
            words = self.words()
            last = words[-1] if words else self._last_line or f"exit status {status}"
            text = self._error or last.removeprefix(f"{COMMAND_NAME}: ").removeprefix("Error: ")  # Click's
            raise EngineError(text.rstrip(". "))
        if self._result is None and _TELLS_RESULT in self.command:
            raise EngineError(
                "it ended without a result: what ran is not the engine", where=self.title, cure="Press Check Engine."
            )
        return self._result or {}

    def words(self) -> list[str]:
        """The last lines of its standard error, at most some kilobytes."""
        try:
            with (self.folder / WORDS_FILE).open("rb") as stream:
                stream.seek(max(0, stream.seek(0, os.SEEK_END) - _TAIL_BYTES))
                lines = stream.read().decode("utf-8", "replace").splitlines()
        except OSError:
            return []
        return [printable(line.strip()) for line in lines if line.strip()]

    def forget(self) -> None:
        """Remove the folder of a job that has ended; one that runs is left alone."""
        if not self.running():
            shutil.rmtree(self.folder, ignore_errors=True)

    def _end(self) -> Mapping[str, Any]:
        """How it ended, once all it told is read; {} where nobody saw its end, or that was changed since."""
        end = read_signed(self.folder / END_FILE)
        if not end or end["events"] != digest_of_events(self.folder):
            return {}
        self._read()
        return end

    def _way_on(self) -> str:
        """What a command that was cut off has left."""
        goes_on = bool(GOING_ON.intersection(self.command[3:4]))  # python -m the library, command
        return "Finished steps are kept; start it again to go on." if goes_on else "Start it again."

    def _read(self) -> None:
        """Take over the whole lines written since; a half-written one waits for its end."""
        try:
            with (self.folder / EVENTS_FILE).open("rb") as stream:
                while True:
                    stream.seek(self._offset)
                    data = stream.read(_READ_BYTES)
                    whole, newline, rest = data.rpartition(b"\n")
                    if not newline and len(data) == _READ_BYTES:
                        whole, rest = data, b""
                    self._offset += len(data) - len(rest)
                    self._take_over(whole.decode("utf-8", "replace").splitlines())
                    if len(data) < _READ_BYTES:
                        return
        except OSError:
            return

    def _take_over(self, lines: Iterable[str]) -> None:
        for line in lines:
            event = _parsed(line)
            if event is None:
                self._last_line = line.strip()[:_TAIL_BYTES] or self._last_line
                continue
            if event.kind == "result":
                self._result = event.data
            elif event.kind == "error":
                self._error = str(event.data.get("text", "the engine failed"))
            self._unread.append(event)


def _this_process() -> dict[str, Any]:
    return {"pid": os.getpid(), "birth": birth(os.getpid())}


def _lives(process: Mapping[str, Any]) -> bool:
    """Whether exactly this process lives, and not another with its number."""
    pid, born = process.get("pid"), process.get("birth")
    return isinstance(pid, int) and 0 < pid < _LARGEST_PID and bool(born) and birth(pid) == born


def _holds_files_alone(folder: Path) -> bool:
    """No links, which would have this program write, read or remove elsewhere, and no pipes."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        return _in_place(folder) and all(entry.is_file(follow_symlinks=False) for entry in entries)
    return False


def _in_place(folder: Path) -> bool:
    """Whether it stands where its name says: it is no link, and no Windows junction."""
    parent = os.path.realpath(folder.parent)
    return os.path.realpath(folder) == str(Path(parent, folder.name))


def _parsed(line: str) -> Event | None:
    try:
        data = parse_json(line)
    except ValueError:
        return None
    if not isinstance(data, dict) or not isinstance(data.get("event"), str):
        return None
    return Event(data["event"], data)
