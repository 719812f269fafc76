"""What runs in the process of a policy: opens its networks and answers ``policy_worker``."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys

import numpy as np

from ...workers.confinement import bound_memory
from ...workers.processes import die_with_parent
from .policy_networks import ONNX, TORCHSCRIPT, Evaluate, PolicyRefusedError, opener, told_in_a_line
from .policy_worker import ANSWER, CLOSE, DONE, FAILED, OPEN, REFUSED, REQUEST, read, write

OPENING_S = {ONNX: 5.0, TORCHSCRIPT: 30.0}
"""Processor time that opening a policy may take, seconds."""

STEP_S = {ONNX: 0.5, TORCHSCRIPT: 3.0}
"""Processor time of a step: what a policy of 50 Hz takes, many times; TorchScript compiles in its first."""

_MORE_MEMORY, _TIMES_FILE = 200_000_000, 10


def serve(not_taken: tuple[str, ...]) -> None:
    """Open and ask networks for who writes to standard input, until nobody does.

    ``not_taken`` is what the process could not give up before.
    """
    die_with_parent()
    to, source = os.dup(1), 0
    os.dup2(2, 1)  # what a program prints is no answer, nor a result of the command's
    sys.stdout = sys.stderr  # and is told line by line
    with contextlib.suppress(EOFError, BrokenPipeError):
        told = json.loads(_line(source))
        kind, content = told["kind"], read(source, told["bytes"])
        opened = opener(kind, told["observations"], told["layout"], told["picture"])
        networks, numbers = dict[int, Evaluate](), "<f4" if told["picture"] is None else "u1"
        not_taken += bound_memory(max(_MORE_MEMORY, _TIMES_FILE * len(content)))
        _answer(to, DONE, json.dumps(not_taken).encode())
        while True:
            what, number, size = REQUEST.unpack(read(source, REQUEST.size))
            observation = np.frombuffer(read(source, size), numbers)
            try:
                actions = b""
                if what == OPEN:
                    _bound_time(OPENING_S[kind])
                    networks[number] = opened(content)
                elif what == CLOSE:
                    networks.pop(number, None)
                else:
                    _bound_time(STEP_S[kind])
                    actions = networks[number](observation).astype("<f4", copy=False).tobytes()
            except PolicyRefusedError as error:
                _answer(to, REFUSED, json.dumps([error.what, error.cure]).encode())
            except Exception as error:  # torch and onnxruntime raise kinds of their own
                _answer(to, FAILED, told_in_a_line(error).encode("utf-8", "replace"))
            else:
                _answer(to, DONE, actions)


def _answer(to: int, what: int, content: bytes) -> None:
    write(to, ANSWER.pack(what, len(content)) + content)


def _line(source: int) -> bytes:
    found = b""
    while not found.endswith(b"\n"):
        found += read(source, 1)
    return found


def _bound_time(seconds: float) -> None:
    """From now on this process may compute for so long, or the system ends it (not on Windows)."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_PROF, seconds)
