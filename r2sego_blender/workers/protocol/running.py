"""A program under way with all that it starts: what it says is read and bounded, and it ends with this process."""

from __future__ import annotations

import contextlib
import json
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from ...core.errors import MachineError, NativeError
from ..child import RUNNING, forget
from ..library_path import external_variables
from ..processes import end_tree, ended_with_this_process, group_of_its_own
from .response import Limits, content_size

_POLL_S, _SIZE_POLL_S = 0.02, 0.25
_MOST_LINE, _REMEMBERED_LINES, _LONGEST_WORDS = 1 << 16, 20, 300


class RunningProgram:
    """A process of a session of its own: ``end``, ``child.kill_children`` and this process's end are all of its end."""

    def __init__(self, command: Sequence[str], name: str, cure: str, kind: str = "worker") -> None:
        """Start it. ``name`` is where errors are, ``cure`` what they advise of this ``kind``. Raises MachineError."""
        self._name, self._cure, self._kind = name, cure, kind
        self._words: deque[str] = deque(maxlen=_REMEMBERED_LINES)
        self._told: Mapping[str, Any] | None = None
        self._heard_s = time.monotonic()
        try:
            self._process = _Tree(
                list(command),
                env=external_variables() | {"PYTHONUTF8": "1"},  # it reads names of folders
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                **group_of_its_own(window=False),
            )
        except OSError as error:
            raise MachineError(f"the {kind} could not be started: {error.strerror}", where=name, cure=cure) from error
        RUNNING.add(self._process)
        self._ender = ended_with_this_process(self._process)
        self._readers = [
            threading.Thread(target=self._read, args=(stream, told), daemon=True)
            for stream, told in ((self._process.stdout, True), (self._process.stderr, False))
        ]
        for reader in self._readers:
            reader.start()

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def ask(self, line: str) -> None:
        """Write a line to its standard input; one that has died is told by its missing answer."""
        assert self._process.stdin is not None
        self._told = None
        with contextlib.suppress(OSError):
            self._process.stdin.write(f"{line}\n".encode())
            self._process.stdin.flush()

    def wait(
        self, answered: Callable[[], bool], folder: Path, tell: Callable[[Mapping[str, Any]], None], limits: Limits
    ) -> int | None:
        """Wait for ``answered`` or the program's end; the exit status, None while it runs.

        Raises NativeError where it takes too long, says nothing for too long, or ``folder`` grows too large.
        """
        began_s = self._heard_s = time.monotonic()
        sized_s = 0.0
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self._process.wait(timeout=_POLL_S)
            if answered():
                return None
            told, self._told = self._told, None
            if told is not None:
                tell(told)
            now_s = time.monotonic()
            if now_s - began_s > limits.seconds:
                raise self.broken(f"had no answer after {limits.seconds:.0f} s")
            if now_s - self._heard_s > limits.silent_s:
                raise self.broken(f"said nothing for {limits.silent_s:.0f} s")
            if now_s - sized_s > _SIZE_POLL_S:
                sized_s = now_s
                with contextlib.suppress(OSError):  # a file that goes meanwhile
                    has, files = content_size(folder)
                    if has > limits.answer_bytes or files > limits.files:
                        raise self.broken(f"wrote more than {limits.answer_bytes} bytes in {limits.files} files")

    def broken(self, how: str) -> NativeError:
        """The error that it ``how``, with its last words."""
        return NativeError(f"the {self._kind} {how}", where=self._name, cure=f"{self._cure}{self._last_words()}")

    def ended(self, status: int) -> NativeError:
        """The error that it ended with such a status."""
        killed = f"was killed by signal {-status}"
        return self.broken(killed if status < 0 else f"ended with exit status {status}")

    def end(self) -> None:
        """End the program and what it started."""
        with contextlib.suppress(OSError):  # a line that was never read
            assert self._process.stdin is not None
            self._process.stdin.close()
        self._process.kill()
        self._ender.kill()  # before the number of the process may be another's
        self._ender.wait()
        self._process.wait()
        forget(self._process)
        for reader in self._readers:
            reader.join(1.0)

    def _last_words(self) -> str:
        if not self.runs:
            for reader in self._readers:
                reader.join(1.0)
        return f" Its last words: {self._words[-1].strip()[:_LONGEST_WORDS]}" if self._words else ""

    def _read(self, stream: IO[bytes], is_told: bool) -> None:
        """Read all that it says and keep little; lines of progress are JSON's objects on its standard output."""
        with stream, contextlib.suppress(OSError, ValueError):
            while line := stream.readline(_MOST_LINE):
                self._heard_s = time.monotonic()
                text = line.decode(errors="replace")
                if is_told and text.startswith("{"):
                    with contextlib.suppress(ValueError, RecursionError):
                        told = json.loads(text)
                        self._told = told
                        continue
                if text.strip():
                    self._words.append(text)


class _Tree(subprocess.Popen):
    """A process that is killed with all it started: a model behind a shell script, say."""

    def kill(self) -> None:
        end_tree(self)
