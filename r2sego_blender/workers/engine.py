"""The engine as a process of its own: ``python -m r2sego_blender …``, followed and cancelled.

Blender needs none of the numeric packages; the interpreter that has them runs this library
as the plain package ``r2sego_blender``, also from inside an installed extension, where its
name in Blender is a longer one. Progress comes back as JSON lines on standard output.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from ..errors import MachineError, R2SEgoError

LIBRARY = Path(__file__).resolve().parents[1]
GRACE_S = 1.0
"""Time a cancelled engine gets to end by itself before it is killed, seconds."""

_INTERPRETER_VARIABLE = "R2SEGO_PYTHON"
_REMEMBERED_LINES = 20
_COMMAND_NAME = "r2sego"


class EngineError(R2SEgoError):
    """A command of the engine that ended without its result."""


@dataclass(frozen=True)
class Event:
    """One line of the engine: ``kind`` is progress, message, result or error."""

    kind: str
    data: Mapping[str, Any]


def find_interpreter(preferred: str = "", fallback: str = "") -> str:
    """The Python that runs the engine: ``preferred``, else $R2SEGO_PYTHON, else ``fallback``.

    Raises MachineError when none is named, or the named one is not there.
    """
    chosen = preferred or os.environ.get(_INTERPRETER_VARIABLE, "") or fallback
    if not chosen:
        raise MachineError(
            "no Python for the engine is chosen",
            cure=f"Set it in the add-on's preferences or in {_INTERPRETER_VARIABLE}: "
            "the python of an environment with r2sego-blender's packages.",
        )
    found = shutil.which(str(Path(chosen).expanduser()))
    if found is None:
        raise MachineError(
            "the engine's Python is not there or cannot be run", where=chosen,
            cure="Choose the python of the engine's environment in the add-on's preferences.",
        )  # fmt: skip
    return found


def ask(arguments: Iterable[str], interpreter: str, timeout_s: float = 60.0) -> str:
    """The standard output of a short command, whatever its exit status.

    Raises MachineError when the interpreter cannot run the engine at all.
    """
    command = [interpreter, "-m", LIBRARY.name, *arguments]
    try:
        done = subprocess.run(
            command, env=_environment(), stdin=subprocess.DEVNULL,
            capture_output=True, text=True, encoding="utf-8", errors="replace", timeout=timeout_s,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MachineError(
            f"the engine does not answer: {error}", where=interpreter,
            cure="Choose another Python in the add-on's preferences.",
        ) from error  # fmt: skip
    if not done.stdout.strip():
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        raise MachineError(
            f"this Python cannot run the engine: {last}", where=interpreter,
            cure="Install the engine's packages there, or choose another Python.",
        )  # fmt: skip
    return done.stdout


def run_in_terminal(arguments: Iterable[str], interpreter: str) -> int:
    """Run a command on this process's own terminal and return its exit status.

    Raises MachineError when the interpreter cannot be started.
    """
    try:
        process = subprocess.Popen([interpreter, "-m", LIBRARY.name, *arguments], env=_environment())
    except OSError as error:
        raise _not_started(interpreter, error) from error
    while True:
        try:
            return process.wait()
        except KeyboardInterrupt:
            pass  # the terminal interrupts both; the engine ends, and this waits for it


class Engine:
    """One running command of the engine."""

    def __init__(self, arguments: Iterable[str], interpreter: str, module: str = "") -> None:
        """Start ``interpreter -m r2sego_blender arguments``, or another ``module`` of the library.

        Raises MachineError when the process cannot be started.
        """
        name = f"{LIBRARY.name}.{module}" if module else LIBRARY.name
        command = [interpreter, "-m", name, *arguments]
        try:
            self._process = subprocess.Popen(
                command, env=_environment(), stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                text=True, encoding="utf-8", errors="replace", **_group_of_its_own(),
            )  # fmt: skip
        except OSError as error:
            raise _not_started(interpreter, error) from error
        self._events: SimpleQueue[Event] = SimpleQueue()
        self._other_lines: deque[str] = deque(maxlen=_REMEMBERED_LINES)
        self._result: Mapping[str, Any] = {}
        self._error = ""
        self._cancelled = False
        self._readers = [
            threading.Thread(target=self._read_events, daemon=True),
            threading.Thread(target=self._read_errors, daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    @property
    def cancelled(self) -> bool:
        """Whether ``cancel`` was called before the command had ended."""
        return self._cancelled

    def events(self) -> list[Event]:
        """The events since the last call, oldest first; never waits."""
        collected = []
        with contextlib.suppress(Empty):
            while True:
                collected.append(self._events.get_nowait())
        return collected

    def running(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    def cancel(self) -> None:
        """Ask the process to end (SIGINT) without waiting; one that has not after ``GRACE_S`` is killed."""
        if self._cancelled or not self.running():
            return
        self._cancelled = True
        self._signal(_INTERRUPT)
        # A timer and not the caller's next look: a window may redraw for seconds.
        killer = threading.Timer(GRACE_S, self._kill)
        killer.daemon = True
        killer.start()

    def stop(self) -> None:
        """End the process now and wait for it: at most ``GRACE_S``, then by force."""
        self.cancel()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE_S)
        self._kill()
        self._process.wait()

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
        try:
            return self.result()
        finally:
            for event in self.events():
                on_event(event)

    def result(self) -> Mapping[str, Any]:
        """Wait for the end and return the data of the result event, empty when there was none.

        Raises EngineError with the engine's own line when it failed, or when it was cancelled.
        """
        status = self._process.wait()
        if self.cancelled:
            self._kill()  # what it started and left behind
        for reader in self._readers:
            # A grandchild may hold the pipe open; what it would still say is not ours.
            reader.join(GRACE_S)
        if self.cancelled and status != 0:
            raise EngineError("cancelled", cure="Finished steps are kept; start it again to go on.")
        if status != 0 or self._error:
            last = self._other_lines[-1] if self._other_lines else f"exit status {status}"
            text = self._error or last.removeprefix(f"{_COMMAND_NAME}: ")
            raise EngineError(text.rstrip(". "))
        return self._result

    def _read_events(self) -> None:
        for line in self._process.stdout:
            event = _parsed(line)
            if event is None:
                if line.strip():
                    self._other_lines.append(line.strip())
                continue
            if event.kind == "result":
                self._result = event.data
            elif event.kind == "error":
                self._error = str(event.data.get("text", "the engine failed"))
            self._events.put(event)

    def _read_errors(self) -> None:
        for line in self._process.stderr:
            if line.strip():
                self._other_lines.append(line.strip())

    def _kill(self) -> None:
        self._signal(_KILL)

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if os.name == "nt":
                self._process.send_signal(number)
            else:
                os.killpg(self._process.pid, number)


def _not_started(interpreter: str, error: OSError) -> MachineError:
    return MachineError(
        f"the engine could not be started: {error}", where=interpreter,
        cure="Choose another Python in the add-on's preferences.",
    )  # fmt: skip


def _parsed(line: str) -> Event | None:
    try:
        data = json.loads(line)
    except json.JSONDecodeError:
        return None
    if not isinstance(data, dict) or not isinstance(data.get("event"), str):
        return None
    return Event(data["event"], data)


def _environment() -> dict[str, str]:
    # PYTHONHOME and the like would point the engine at Blender's own Python.
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONHOME", "PYTHONSTARTUP")}
    paths = [str(LIBRARY.parent), kept.get("PYTHONPATH", "")]
    kept["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    kept["PYTHONSAFEPATH"] = "1"  # the folder the person stands in is not searched for modules
    kept["PYTHONUNBUFFERED"] = "1"
    kept["PYTHONUTF8"] = "1"
    return kept


if sys.platform == "win32":
    _INTERRUPT, _KILL = signal.CTRL_BREAK_EVENT, signal.SIGTERM

    def _group_of_its_own() -> dict[str, Any]:
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP | subprocess.CREATE_NO_WINDOW}
else:
    _INTERRUPT, _KILL = signal.SIGINT, signal.SIGKILL

    def _group_of_its_own() -> dict[str, Any]:
        return {"start_new_session": True}
