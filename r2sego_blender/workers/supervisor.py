"""What stands between a job and whoever follows it: ``python -m r2sego_blender.workers.supervisor FOLDER``.

Starts the command of the job folder, writes down who it is and how the command ended, and
ends it when the file ``cancel`` appears. It outlives the Blender that started it, so a job
is cancelled the same way by the Blender that began it and by a later one.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from .processes import DYING_WITH_PARENT, birth, end_tree, group_of_its_own, interrupt_group, take_children_along

JOB_FILE, PROCESS_FILE, END_FILE = "job.json", "process.json", "end.json"
EVENTS_FILE, WORDS_FILE, CANCEL_FILE = "events.jsonl", "stderr.txt", "cancel"
GRACE_S = 1.0
"""Time a cancelled command gets to end by itself before it is killed, seconds."""

_LOOK_S = 0.1


def write_record(file: Path, record: dict[str, Any]) -> None:
    """Write JSON so that a reader sees all of it or nothing."""
    write_whole(file, json.dumps(record))


def supervise(folder: Path) -> None:
    """Run the job of ``folder`` to its end and write ``end.json``: its exit status, or why none."""
    asked = []  # a handler and not SIG_IGN, which the command would inherit
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: asked.append(True))
    write_record(folder / PROCESS_FILE, {"pid": os.getpid(), "birth": birth(os.getpid())})
    take_children_along()
    command = json.loads((folder / JOB_FILE).read_text(encoding="utf-8"))["command"]
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
            write_record(folder / END_FILE, {"status": None, "error": str(error), "ended": time.time()})
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
        write_record(folder / END_FILE, {"status": status, "error": "", "ended": time.time()})


if __name__ == "__main__":
    supervise(Path(sys.argv[1]))
