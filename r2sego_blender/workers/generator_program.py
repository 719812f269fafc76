"""Generators that are programs of a person's own, as workers: any video model, in whatever environment it needs.

The program is started as ``COMMAND FOLDER``; docs/backends.md tells what lies in that folder and
what it has to write there. It may end after its answer, or wait: then each further line on its
standard input names the folder of the next clip, so that a large model is loaded once.
"""

from __future__ import annotations

import stat
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.errors import MachineError, NativeError
from ..core.json_files import read_json, write_json
from .protocol.asking import Tell
from .protocol.response import Limits, RefusedRequestError
from .protocol.running import RunningProgram
from .protocol.serving import REQUEST_FILE, Answer, write_answer
from .signed_records import read_record

PROTOCOL = 1
"""Version of what a generator's program is asked and tells."""

_FOLDERS = ("frames", "confidence")
_LONGEST_WORDS = 300


class GeneratorProgram:
    """One generator program, started with the first clip and again after it has ended. It serves the task "clip".

    ``close`` ends it; so do ``child.kill_children`` and this process's end.
    """

    def __init__(self, command: Sequence[str], name: str, cure: str) -> None:
        """``name`` is where errors are, ``cure`` what they advise when it breaks."""
        self.name, self.cure = name, cure
        self._command = list(command)
        self._program: RunningProgram | None = None

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """See ``asking.Worker``: ``request`` is the program's folder, the request's parameters lie beside its fields.

        Raises RefusedRequestError when the program declines this clip, MachineError when it cannot be
        started or says what it lacks, NativeError when it broke, hung or left no complete result.
        """
        began_s = time.monotonic()
        record = read_json(request / REQUEST_FILE)
        write_json(request / REQUEST_FILE, {**record, **record["parameters"], "protocol": PROTOCOL})
        if self._program is not None and self._program.runs:
            self._program.ask(str(request))
        else:
            self.close()
            self._program = RunningProgram([*self._command, str(request)], self.name, self.cure, "generator")
        file = request / "result.json"
        status = self._program.wait(lambda: bool(read_record(file).get("waits")), request, tell, limits)
        result = read_record(file)
        self._check(self._program, result, status)
        if status is not None:
            self.close()
        if "refused" in result:
            refused = str(result["refused"])[:_LONGEST_WORDS]
            raise RefusedRequestError(f"the generator refused, {refused}", where=self.name)
        given = Answer(str(result["backend"]), "", _frames(request), {"frames": result["frames"]})
        write_answer(response, "clip", given, began_s)

    def close(self) -> None:
        """End the program and what it started, if it runs."""
        if self._program is not None:
            self._program.end()
            self._program = None

    def _check(self, program: RunningProgram, result: dict[str, Any], status: int | None) -> None:
        if "error" in result:
            what, cure = (str(result.get(name) or "")[:_LONGEST_WORDS] for name in ("error", "cure"))
            raise MachineError(what, where=self.name, cure=cure or self.cure)
        if status:
            raise program.ended(status)
        if not result:
            raise program.broken("left no result.json that can be read")
        needed = {"protocol"} if "refused" in result else {"protocol", "backend", "frames"}
        missing = sorted(needed - result.keys())
        if missing or result["protocol"] != PROTOCOL:
            what = f"lacks {', '.join(missing)}" if missing else f"follows protocol {result['protocol']}"
            raise NativeError(
                f"the result.json of the generator {what}",
                where=self.name,
                cure=f"This R2S-EGO follows protocol {PROTOCOL}, see docs/backends.md.",
            )


def _frames(folder: Path) -> dict[str, Path]:
    """The images that a program left, by their places; a link is none."""
    found: dict[str, Path] = {}
    for name in _FOLDERS:
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            files = sorted((folder / name).glob("[0-9][0-9][0-9].png"))
            found |= {f"{name}/{file.name}": file for file in files if stat.S_ISREG(file.lstat().st_mode)}
    return found
