"""Run a function in a process of its own, so that native code may abort alone.

pycolmap and CoACD can end the interpreter, even with exit status 0, on input they do not
like. A call here succeeds only when the process exits with 0 *and* has left a complete
result manifest.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..core.errors import NativeError, R2SEgoError
from ..core.scratch import ScratchFolder
from ..core.text_files import write_text
from .library_path import IMPORT_LIBRARY, LIBRARY
from .processes import die_with_parent

_PACKAGE = __package__.rpartition(".")[0]
_CHILD = f"{IMPORT_LIBRARY}\nfrom {LIBRARY.name}.workers.child import serve_call\nserve_call(*sys.argv[1:])\n"

RUNNING: set[subprocess.Popen] = set()
"""The processes that ``kill_children`` ends."""

_GOING_ON = threading.Lock()
_GONE_S = 0.3


def kill_children(for_good: bool = False) -> None:
    """End every native call and worker under way.

    ``for_good`` where this process ends next: nobody hears of their end any more.
    """
    if for_good:
        _GOING_ON.acquire()
    ended = tuple(RUNNING)
    for process in ended:
        process.kill()
    for process in ended:  # Windows removes no file of one that is not gone yet
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_GONE_S)


def forget(process: subprocess.Popen) -> None:
    """Take a process that has ended from RUNNING; waits for ever once they were killed for good."""
    RUNNING.discard(process)
    with _GOING_ON:
        pass


def call_in_child(
    function: Callable[[dict], dict], request: dict[str, Any], *, timeout_s: float = 1800.0
) -> dict[str, Any]:
    """Call ``function`` with ``request`` in a new process and return its result.

    ``function``, from one JSON-ready dict to another, stands at the top of a module of this
    library, or of one the child can import; large data goes through files named in the request.
    An R2SEgoError raised inside is raised here again; anything else, an abort or a time-out is a
    NativeError that carries the last line the process printed.
    """
    module = function.__module__
    if module.startswith(f"{_PACKAGE}."):  # a longer one inside Blender
        module = f"{LIBRARY.name}{module.removeprefix(_PACKAGE)}"
    name = f"{module}:{function.__name__}"
    with ScratchFolder() as folder:
        request_file, manifest = Path(folder, "request.json"), Path(folder, "manifest.json")
        write_text(request_file, json.dumps(request))
        command = [sys.executable, "-c", _CHILD, name, str(request_file), str(manifest)]
        process = subprocess.Popen(
            command,
            env=_environment(folder),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
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
            forget(process)
        outcome: dict[str, Any] = json.loads(manifest.read_text(encoding="utf-8")) if manifest.is_file() else {}
        if "error" in outcome:
            raise _error_class(outcome["error"])(outcome["what"], where=outcome["where"], cure=outcome["cure"])
        if process.returncode != 0 or not outcome.get("complete"):
            lines = [line for line in printed.splitlines() if line.strip()]
            last = f" Its last words: {lines[-1][:300]}" if lines else ""
            raise NativeError(
                f"{name} ended without a result (exit status {process.returncode})",
                cure=f"Its input is probably damaged.{last}",
            )
        result: dict[str, Any] = outcome["result"]
        return result


def _environment(folder: str) -> dict[str, str]:
    # What a killed child leaves among its temporary files goes with the request.
    return dict(os.environ) | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)


def _error_class(name: str) -> type[R2SEgoError]:
    from ..core import errors

    return getattr(errors, name, NativeError)


def serve_call(function: str, request_file: str, manifest: str) -> None:
    """The child's side: call ``function``, "module:name", and leave the manifest."""
    die_with_parent()  # nobody would hear of the result
    module_name, _, name = function.partition(":")
    module = importlib.import_module(module_name)
    request = json.loads(Path(request_file).read_text(encoding="utf-8"))
    try:
        outcome = {"complete": True, "result": getattr(module, name)(request)}
    except R2SEgoError as error:
        outcome = {"error": type(error).__name__, "what": error.what, "where": error.where, "cure": error.cure}
    unfinished = Path(manifest + ".tmp")
    write_text(unfinished, json.dumps(outcome))
    unfinished.replace(manifest)
