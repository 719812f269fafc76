"""Run a function in a process of its own, so that native code may abort alone.

pycolmap and CoACD can end the interpreter, even with exit status 0, on input they do not
like. A call here succeeds only when the process exits with 0 *and* has left a complete
result manifest.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import NativeError, R2SEgoError

_PACKAGE = __package__.rpartition(".")[0]
_PACKAGE_PARENT = Path(__file__).resolve().parents[1 + _PACKAGE.count(".") + 1]

RUNNING: set[subprocess.Popen] = set()
"""The processes that ``kill_children`` ends."""


def kill_children() -> None:
    """End every native call and worker under way; for a process that is being cancelled."""
    for process in tuple(RUNNING):
        process.kill()


def call_in_child(
    function: Callable[[dict], dict],
    request: dict[str, Any],
    *,
    timeout_s: float = 1800.0,
    python: str = sys.executable,
) -> dict[str, Any]:
    """Call ``function`` with ``request`` in a new process and return its result.

    ``function``, from one JSON-ready dict to another, stands at the top of an importable
    module; large data goes through files named in the request. ``python`` is the interpreter,
    of another environment if need be. An R2SEgoError raised inside
    is raised here again; anything else, an abort or a time-out is a NativeError that carries
    the last line the process printed.
    """
    name = f"{function.__module__}:{function.__name__}"
    with tempfile.TemporaryDirectory(prefix="r2sego-") as folder:
        request_file, manifest = Path(folder, "request.json"), Path(folder, "manifest.json")
        request_file.write_text(json.dumps(request))
        environment = dict(os.environ)
        paths = [str(_PACKAGE_PARENT), environment.get("PYTHONPATH", "")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
        command = [python, "-m", __name__, name, str(request_file), str(manifest)]
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        )  # fmt: skip
        RUNNING.add(process)
        try:
            printed, _ = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired as error:
            raise NativeError(
                f"{name} took longer than {timeout_s:.0f} s", cure="Use fewer or smaller images."
            ) from error
        finally:
            process.kill()
            process.wait()
            RUNNING.discard(process)
        outcome = json.loads(manifest.read_text()) if manifest.is_file() else {}
        if "error" in outcome:
            raise _error_class(outcome["error"])(
                outcome["what"], where=outcome["where"], cure=outcome["cure"]
            )
        if process.returncode != 0 or not outcome.get("complete"):
            lines = [line for line in printed.splitlines() if line.strip()]
            last = f" Its last words: {lines[-1][:300]}" if lines else ""
            raise NativeError(
                f"{name} ended without a result (exit status {process.returncode})",
                cure=f"Its input is probably damaged.{last}",
            )
        return outcome["result"]


def _error_class(name: str) -> type[R2SEgoError]:
    from .. import errors

    return getattr(errors, name, NativeError)


def _main(function: str, request_file: str, manifest: str) -> None:
    module_name, _, name = function.partition(":")
    module = importlib.import_module(module_name)
    request = json.loads(Path(request_file).read_text())
    try:
        outcome = {"complete": True, "result": getattr(module, name)(request)}
    except R2SEgoError as error:
        outcome = {
            "error": type(error).__name__, "what": error.what,
            "where": error.where, "cure": error.cure,
        }  # fmt: skip
    unfinished = Path(manifest + ".tmp")
    unfinished.write_text(json.dumps(outcome))
    unfinished.replace(manifest)


if __name__ == "__main__":
    _main(*sys.argv[1:])
