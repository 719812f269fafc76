"""A child process that reads inputs for this one, and what is made of its death and its silence."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HANG_S = 20.0
_READY_S = 300.0
"""For what is built and imported before the first input, and for making the next."""

_CHILD = (sys.executable, "-m", "tools.fuzzing.child")
_ROOT = Path(__file__).parents[2]


class Child:
    """A process that reads inputs of a seed; a new one is started where it died or hung.

    ``formats`` is the module whose ``HARNESSES`` it knows, ``hang_s`` how long it may be silent.
    """

    def __init__(self, seed: int, formats: str = "tools.fuzzing.formats", hang_s: float = HANG_S) -> None:
        self._seed, self._formats, self._hang_s = seed, formats, hang_s
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._unread = b""

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def outcomes(self, name: str, first: int, after: int) -> Iterator[tuple[dict[str, Any], Path]]:
        """What becomes of each input of a format, and a file that holds those that failed until the next is asked for.

        A death or a silence of more than ``hang_s`` is of the input that had begun. Raises RuntimeError
        where it was none's.
        """
        while first < after:
            self._start()
            assert self._process is not None and self._process.stdin is not None
            self._process.stdin.write(f"{name} {first} {after}\n".encode())
            self._process.stdin.flush()
            file, begun, limit_s = Path(), {}, _READY_S
            while True:
                told = self._line(limit_s)
                if told is None or isinstance(told, str):
                    break
                if "done" in told:
                    return
                if "wrong" in told:
                    raise RuntimeError(f"{name}: {told['wrong']}")
                if "ready" in told:
                    file = Path(told["file"])
                elif "begins" in told:
                    begun, limit_s = told, self._hang_s
                else:
                    kept = Path(told.pop("kept", file))
                    yield told, kept
                    if kept != file:
                        kept.unlink()
                    first, begun, limit_s = told["number"] + 1, {}, _READY_S
            if not begun:
                self.end()
                raise RuntimeError(f"{name} {first}: the process that reads ended between two inputs: {told}")
            hung = told is None
            size = file.stat().st_size if file.is_file() else 0
            outcome = {"number": begun["begins"], "change": begun["change"], "bytes": size, "s": self._hang_s, "mb": 0}
            said = "" if hung else str(told)
            yield {**outcome, "class": "hang" if hung else "death", "text": said}, file
            self.end()
            first = begun["begins"] + 1

    def _start(self) -> None:
        if self._process is not None and self._process.poll() is None:
            return
        self.end()
        shared = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
        self._folder = Path(tempfile.mkdtemp(prefix="r2sego_fuzzing_", dir=shared))
        (self._folder / "inputs").mkdir()
        self._process = subprocess.Popen(
            [*_CHILD, str(self._seed), str(self._folder / "inputs"), self._formats],
            cwd=_ROOT,
            env=os.environ | {"TMPDIR": str(self._folder), "PYTHONHASHSEED": "0"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=(self._folder / "stderr").open("wb"),
            start_new_session=True,
        )
        self._unread = b""

    def _line(self, limit_s: float) -> dict[str, Any] | str | None:
        """The next answer; the words of its death, or None after so long a silence."""
        assert self._process is not None and self._process.stdout is not None
        while b"\n" not in self._unread:
            if not select.select([self._process.stdout], [], [], limit_s)[0]:
                return None
            data = os.read(self._process.stdout.fileno(), 1 << 16)
            if not data:
                status = self._process.wait()
                last = (self._folder / "stderr").read_text(errors="replace").strip().splitlines()[-12:]
                return f"status {status}: {' | '.join(last)}"[:600]
            self._unread += data
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def end(self) -> None:
        """End the process; the next inputs are another's."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                with contextlib.suppress(OSError):
                    assert stream is not None
                    stream.close()
            shutil.rmtree(self._folder, ignore_errors=True)
        self._process = None
