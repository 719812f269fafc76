"""What stands between a job and whoever follows it: ``python -m r2sego_blender.workers.supervisor FOLDER``.

Starts the command of the job folder, writes down who it is and how the command ended, and
ends it when the file ``cancel`` appears. It outlives the Blender that started it, so a job
is cancelled the same way by the Blender that began it and by a later one. What it runs and how that
ended are signed records: a bundle from elsewhere starts nothing and has ended nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from ..core.text_files import opened_file
from .processes import DYING_WITH_PARENT, birth, end_tree, group_of_its_own, interrupt_group, take_children_along
from .signed_records import read_signed, write_signed

JOB_FILE, PROCESS_FILE, END_FILE = "job.json", "process.json", "end.json"
EVENTS_FILE, WORDS_FILE, CANCEL_FILE = "events.jsonl", "stderr.txt", "cancel"
GRACE_S = 1.0
"""Time a cancelled command gets to end by itself before it is killed, seconds."""

_LOOK_S = 0.1
_MOST_EVENTS_BYTES = 256 << 20


def write_record(file: Path, record: dict[str, Any]) -> None:
    """Write JSON so that a reader sees all of it or nothing."""
    write_whole(file, json.dumps(record))


def digest_of_events(folder: Path) -> str:
    """SHA-256 of what the command of a job told, "" where that cannot be read or is beyond all measure."""
    with contextlib.suppress(OSError, ValueError), opened_file(folder / EVENTS_FILE) as stream:
        if os.fstat(stream.fileno()).st_size <= _MOST_EVENTS_BYTES:
            digest = hashlib.sha256()
            while block := stream.read(1 << 20):
                digest.update(block)
            return digest.hexdigest()
    return ""


def supervise(folder: Path) -> None:
    """Run the job of ``folder`` to its end and write ``end.json``: its exit status, or why none.

    Raises KeyError for a job that this machine's person did not start.
    """
    command = read_signed(folder / JOB_FILE)["command"]
    asked = []  # a handler and not SIG_IGN, which the command would inherit
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked.append(True))
    write_record(folder / PROCESS_FILE, {"pid": os.getpid(), "birth": birth(os.getpid())})
    take_children_along()
    with (folder / EVENTS_FILE).open("ab") as events, (folder / WORDS_FILE).open("ab") as words:
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=events,
                stderr=words,
                **DYING_WITH_PARENT,
                **group_of_its_own(),
            )
        except OSError as error:
            _write_end(folder, None, str(error))
            return
    interrupted_s = None
    while process.poll() is None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_LOOK_S)
            break
        if interrupted_s is None and (asked or (folder / CANCEL_FILE).exists()):
            interrupted_s = time.monotonic()
            interrupt_group(process)
        elif interrupted_s is not None and time.monotonic() - interrupted_s > GRACE_S:
            end_tree(process)
    end_tree(process)  # what it started and left behind
    status = process.wait()
    with contextlib.suppress(OSError):  # the folder was taken away
        _write_end(folder, status)


def _write_end(folder: Path, status: int | None, error: str = "") -> None:
    end = {"status": status, "error": error, "ended": time.time(), "events": digest_of_events(folder)}
    write_signed(folder / END_FILE, end)


if __name__ == "__main__":
    supervise(Path(sys.argv[1]))
