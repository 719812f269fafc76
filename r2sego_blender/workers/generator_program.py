"""Generators that are programs: any video model, in whatever environment it needs.

The program is started as ``COMMAND FOLDER``; docs/backends.md tells what lies in that folder and
what it has to write there. It may end after its answer, or wait: then each further line on its
standard input names the folder of the next clip, so that a large model is loaded once.
"""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

from ..core.errors import GenerationError, MachineError, NativeError
from ..core.json_files import read_json
from .child import RUNNING, forget
from .external_environment import PROTOCOL
from .library_path import external_variables
from .processes import DYING_WITH_PARENT, end_tree, group_of_its_own

CLIP_LIMIT_S = 3600.0
"""Time after which a program without an answer counts as hung, seconds."""

_POLL_S = 0.05
_MOST_BYTES = 1 << 20


class GeneratorProgram:
    """One generator program, started with the first clip and again after it has ended.

    Leaving the context ends it; so do ``child.kill_children`` and, on Linux, this process's end.
    """

    def __init__(self, command: Sequence[str], name: str, cure: str, limit_s: float = CLIP_LIMIT_S) -> None:
        """``name`` is where errors are, ``cure`` what they advise when it breaks."""
        self._command, self._name, self._cure, self._limit_s = list(command), name, cure, limit_s
        self._process: subprocess.Popen | None = None
        self._said: IO[bytes] | None = None

    def __enter__(self) -> GeneratorProgram:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def answer(self, folder: Path) -> dict[str, Any]:
        """The result for the request in ``folder``, with ``backend`` and ``frames``.

        Raises GenerationError when the program declines this clip, MachineError when it cannot be
        started or says what it lacks, NativeError when it broke, hung or left no complete result.
        """
        try:
            self._ask(folder)
            result, status = self._await(folder / "result.json")
            self._check(result, status)
        except BaseException:
            self.close()  # what it would still write must not answer the next clip
            raise
        if status is not None:
            self.close()
        if "refused" in result:
            raise GenerationError(f"the generator refused, {result['refused']}", where=self._name)
        return result

    def close(self) -> None:
        """End the program and what it started, if it runs."""
        if self._process is None:
            return
        assert self._process.stdin is not None and self._said is not None
        with contextlib.suppress(OSError):  # a folder that was never read
            self._process.stdin.close()
        self._process.kill()
        self._process.wait()
        forget(self._process)
        self._said.close()
        self._process = None

    def _ask(self, folder: Path) -> None:
        if self._process is not None and self._process.poll() is None:
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):  # one that has died is told by its missing answer
                self._process.stdin.write(f"{folder}\n".encode())
                self._process.stdin.flush()
            return
        self.close()
        # A file, not a pipe: nobody has to read along, and nothing it starts can hold it open.
        self._said = tempfile.TemporaryFile(prefix="r2sego-")  # noqa: SIM115
        try:
            self._process = _Tree(
                [*self._command, str(folder)],
                env=external_variables() | {"PYTHONUTF8": "1"},  # it reads names of folders
                stdin=subprocess.PIPE,
                stdout=self._said,
                stderr=subprocess.STDOUT,
                **DYING_WITH_PARENT,
                **group_of_its_own(window=False),
            )
        except OSError as error:
            self._said.close()
            raise MachineError(
                f"the generator could not be started: {error.strerror}", where=self._name, cure=self._cure
            ) from error
        RUNNING.add(self._process)

    def _await(self, file: Path) -> tuple[dict[str, Any], int | None]:
        """What ``file`` says in the end, {} for nothing, and the exit status, None if it waits."""
        assert self._process is not None
        deadline_s = time.monotonic() + self._limit_s
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                status = self._process.wait(timeout=_POLL_S)
                return _read(file), status
            result = _read(file)
            if result.get("waits"):
                return result, None
            if time.monotonic() > deadline_s:
                raise self._broken(f"had no answer after {self._limit_s:.0f} s")

    def _check(self, result: dict[str, Any], status: int | None) -> None:
        if "error" in result:
            raise MachineError(str(result["error"]), where=self._name, cure=result.get("cure") or self._cure)
        if status:
            killed = f"was killed by signal {-status}"
            raise self._broken(killed if status < 0 else f"ended with exit status {status}")
        if not result:
            raise self._broken("left no result.json that can be read")
        needed = {"protocol"} if "refused" in result else {"protocol", "backend", "frames"}
        missing = sorted(needed - result.keys())
        if missing or result["protocol"] != PROTOCOL:
            what = f"lacks {', '.join(missing)}" if missing else f"follows protocol {result['protocol']}"
            raise NativeError(
                f"the result.json of the generator {what}",
                where=self._name,
                cure=f"This R2S-EGO follows protocol {PROTOCOL}, see docs/backends.md.",
            )

    def _broken(self, how: str) -> NativeError:
        cure = f"{self._cure}{self._last_words()}"
        return NativeError(f"the generator {how}", where=self._name, cure=cure)

    def _last_words(self) -> str:
        assert self._said is not None
        self._said.seek(0)
        lines = [line for line in self._said.read().decode(errors="replace").splitlines() if line.strip()]
        return f" Its last words: {lines[-1].strip()[:300]}" if lines else ""


class _Tree(subprocess.Popen):
    """A process that is killed with all it started: a model behind a shell script, say."""

    def kill(self) -> None:
        end_tree(self)


def _read(file: Path) -> dict[str, Any]:
    """The JSON object in ``file``; {} where there is none, or one that is still being written."""
    with contextlib.suppress(OSError, ValueError):
        result = read_json(file, _MOST_BYTES)
        return result if isinstance(result, dict) else {}
    return {}
