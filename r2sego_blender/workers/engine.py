"""The engine's Python: which it is, how it finds this library, and short questions to it.

Blender needs none of the numeric packages; the interpreter that has them runs this library
as the plain package ``r2sego_blender``, also from inside an installed extension, where its
name in Blender is a longer one. What takes longer is a job (``jobs.py``).
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

from ..core.errors import MachineError
from .processes import NO_WINDOW
from .programs import find_program

LIBRARY = Path(__file__).resolve().parents[1]
COMMAND_NAME = "r2sego"
GOING_ON = frozenset({"demo", "evaluate", "experiment", "policy", "refine", "reproduce", "rollouts", "select"})
"""Commands that, cut off and started again, go on from the last step they finished."""

_INTERPRETER_VARIABLE = "R2SEGO_PYTHON"


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
    found = find_program(str(Path(chosen).expanduser()))
    if found is None:
        raise MachineError(
            "the engine's Python is not there or cannot be run",
            where=chosen,
            cure="Choose the python of the engine's environment in the add-on's preferences.",
        )
    return found


def ask(arguments: Iterable[str], interpreter: str, timeout_s: float = 60.0) -> str:
    """The standard output of a short command, whatever its exit status.

    Raises MachineError when the interpreter cannot run the engine at all.
    """
    command = [interpreter, "-m", LIBRARY.name, *arguments]
    try:
        done: subprocess.CompletedProcess[str] = subprocess.run(
            command,
            env=engine_environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            timeout=timeout_s,
            **NO_WINDOW,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MachineError(
            f"the engine does not answer: {error}",
            where=interpreter,
            cure="Choose another Python in the add-on's preferences.",
        ) from error
    if not done.stdout.strip():
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        raise MachineError(
            f"this Python cannot run the engine: {last}",
            where=interpreter,
            cure="Install the engine's packages there, or choose another Python.",
        )
    return done.stdout


def run_in_terminal(arguments: Iterable[str], interpreter: str) -> int:
    """Run a command on this process's own terminal and return its exit status.

    Whoever ends this process ends the command: what terminates it is passed on. Raises
    MachineError when the interpreter cannot be started.
    """
    try:
        process = subprocess.Popen([interpreter, "-m", LIBRARY.name, *arguments], env=engine_environment())
    except OSError as error:
        raise _not_started(interpreter, error) from error
    with _passing_on(process):
        while True:
            try:
                return process.wait()
            except KeyboardInterrupt:
                pass  # the terminal interrupts both; the engine ends, and this waits for it


@contextlib.contextmanager
def _passing_on(process: subprocess.Popen) -> Iterator[None]:
    """Send ``process`` the SIGTERM and SIGHUP that this one gets, where it can hear them."""
    if os.name == "nt" or threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is not signal.SIG_IGN]
    before = {n: signal.signal(n, lambda number, _: process.send_signal(number)) for n in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


def _not_started(interpreter: str, error: OSError) -> MachineError:
    return MachineError(
        f"the engine could not be started: {error}",
        where=interpreter,
        cure="Choose another Python in the add-on's preferences.",
    )


def engine_environment() -> dict[str, str]:
    """The variables with which another Python finds this library, and nothing of this one's own."""
    # PYTHONHOME and the like would point the engine at Blender's own Python.
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONHOME", "PYTHONSTARTUP")}
    paths = [str(LIBRARY.parent), kept.get("PYTHONPATH", "")]
    kept["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    kept["PYTHONSAFEPATH"] = "1"  # the folder the person stands in is not searched for modules
    kept["PYTHONUNBUFFERED"] = "1"
    kept["PYTHONUTF8"] = "1"
    return kept
