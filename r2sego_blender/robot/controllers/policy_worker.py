"""A policy's network in a process of its own, asked through a pipe.

A file of a policy is a stranger's: a TorchScript program does what it likes, a damaged one ends its
process, and an ONNX graph may ask for all memory or never end. So it is opened and run where there
is nothing to write or reach, with bounds on memory and on the time of a step (``policy_service``).
One process serves all attempts of a policy; an observation goes there and actions come back as
plain float32.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import weakref
from typing import NoReturn

import numpy as np

from ...core.threads import BLAS_VARIABLE
from ...workers.child import RUNNING, forget
from ...workers.library_path import IMPORT_LIBRARY, LIBRARY
from ...workers.processes import NO_WINDOW
from .policy_networks import Evaluate, PolicyRefusedError
from .telemetry import OPT_OUT

SILENT_S = 60.0
"""A process that waits for something, and computes nothing, is ended after this time, seconds."""

REQUEST, ANSWER = struct.Struct("<BIQ"), struct.Struct("<BQ")
"""What begins a request (what, of which network, bytes that follow) and an answer (what, bytes)."""

OPEN, CLOSE, STEP = range(3)
DONE, REFUSED, FAILED = range(3)

_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", BLAS_VARIABLE, "MKL_NUM_THREADS"), "1")
# Rights are given up before anything could start a thread, which would keep them.
_SERVE = f"""{IMPORT_LIBRARY}
from {LIBRARY.name}.workers.confinement import confine
not_taken = confine()
from {LIBRARY.name}.robot.controllers.policy_service import serve
serve(not_taken)
"""


class PolicyFailedError(Exception):
    """A network, or its process, that failed as it was opened or asked; its text is one line."""


class PolicyWorker:
    """The process of one policy. It ends with this process, with ``kill_children`` and with this object."""

    def __init__(
        self, kind: str, content: bytes, observations: int, layout: str, picture: tuple[int, int, int] | None = None
    ) -> None:
        """A policy of so many ``observations``, as the file ``layout`` says, and of a ``picture`` where it sees:
        rows, columns, channels. Raises PolicyFailedError."""
        self._numbers, self._closed = itertools.count(), list[int]()
        self._process = subprocess.Popen(
            [sys.executable, "-c", _SERVE],
            env={**os.environ, **OPT_OUT, **_ONE_THREAD, "PYTHONSAFEPATH": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            **NO_WINDOW,
        )
        RUNNING.add(self._process)
        self._deadline = [time.monotonic() + SILENT_S]
        self._end = weakref.finalize(self, _end, self._process)
        threading.Thread(target=_watch, args=(self._process, self._deadline), daemon=True).start()
        assert self._process.stdin is not None and self._process.stdout is not None
        self._to, self._from = self._process.stdin.fileno(), self._process.stdout.fileno()
        told = json.dumps(
            {"kind": kind, "bytes": len(content), "observations": observations, "layout": layout, "picture": picture}
        ).encode()
        self.not_taken: tuple[str, ...] = tuple(json.loads(self._asked(told + b"\n" + content)))
        """What this system could not take away from the process (``workers.confinement``)."""

    def network(self) -> Evaluate:
        """The network as it is before its first observation.

        Raises PolicyRefusedError and PolicyFailedError; calling it, PolicyFailedError.
        """
        for number in self._closed[:]:
            self._asked(REQUEST.pack(CLOSE, number, 0))
            self._closed.remove(number)
        number = next(self._numbers)
        self._asked(REQUEST.pack(OPEN, number, 0))

        def evaluate(observation: np.ndarray) -> np.ndarray:
            seen = observation.dtype == np.uint8
            told = (observation if seen else observation.astype("<f4", copy=False)).tobytes()
            return np.frombuffer(self._asked(REQUEST.pack(STEP, number, len(told)) + told), "<f4")

        weakref.finalize(evaluate, self._closed.append, number)
        return evaluate

    def _asked(self, request: bytes) -> bytes:
        self._deadline[0] = time.monotonic() + SILENT_S
        try:
            write(self._to, request)
            what, size = ANSWER.unpack(read(self._from, ANSWER.size))
            content = read(self._from, size)
        except (OSError, EOFError):
            self._died()
        self._deadline[0] = float("inf")
        if what == REFUSED:
            raise PolicyRefusedError(*json.loads(content))
        if what == FAILED:
            raise PolicyFailedError(content.decode("utf-8", "replace"))
        return content

    def _died(self) -> NoReturn:
        status = self._process.wait()
        self._end()
        if status == -getattr(signal, "SIGPROF", 0):
            raise PolicyFailedError("it computes without an end")
        if self._deadline[0] < time.monotonic():
            raise PolicyFailedError("it does not answer")
        raise PolicyFailedError(f"its process ended with the status {status}, as damaged files have it")


def _end(process: subprocess.Popen) -> None:
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
    forget(process)


def _watch(process: subprocess.Popen, deadline: list[float]) -> None:
    while process.poll() is None:
        if time.monotonic() > deadline[0]:
            process.kill()
        time.sleep(1.0)


def write(descriptor: int, content: bytes) -> None:
    """Write all of it. Raises OSError."""
    left = memoryview(content)
    while left:
        left = left[os.write(descriptor, left) :]


def read(descriptor: int, size: int) -> bytes:
    """So many bytes. Raises EOFError where the other side has ended."""
    found = os.read(descriptor, size) if size else b""
    while len(found) < size:
        if not (more := os.read(descriptor, size - len(found))):
            raise EOFError
        found += more
    return found
