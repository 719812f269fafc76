"""Processes that are started afresh and leave the person's script alone.

Python's ``spawn`` runs the main script again in each new process, so that functions of it
can be called there. A script without ``if __name__ == "__main__"`` would then start all its
work once more, and wait for itself for ever. Nothing of a script is called here.

It also finds modules in the folder that the person stands in before its own: a ``struct.py`` there
would be run, and could keep the process from starting. ``PYTHONSAFEPATH`` leaves that folder out.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import context, process, resource_tracker
from typing import Any

_one_at_a_time = threading.Lock()


class _Process(context.SpawnProcess):
    @staticmethod
    def _Popen(process_obj: process.BaseProcess) -> Any:  # noqa: N802  (multiprocessing's name)
        with _main_script_hidden(), _safe_path():
            return context.SpawnProcess._Popen(process_obj)


class SpawnContext(context.SpawnContext):
    """multiprocessing's ``spawn``, whose processes do not run the main script again."""

    Process = _Process

    def __init__(self) -> None:
        if sys.platform != "win32":  # its helper process, which is started before the first of ours
            with _one_at_a_time, _safe_path():
                resource_tracker.ensure_running()


@contextmanager
def _main_script_hidden() -> Iterator[None]:
    """``__main__`` without what ``multiprocessing.spawn.get_preparation_data`` finds it by."""
    main = vars(sys.modules["__main__"])
    with _one_at_a_time:
        told: dict[str, Any] = {name: main[name] for name in ("__spec__", "__file__") if name in main}
        main.update(dict.fromkeys(told))
        try:
            yield
        finally:
            main.update(told)


@contextmanager
def _safe_path() -> Iterator[None]:
    """What is started looks for no modules in the working folder."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before
