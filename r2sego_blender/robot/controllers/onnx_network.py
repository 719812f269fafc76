"""A released network with one input and one output, which a person brings: opened as any stranger's policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import RobotError
from .policy_networks import ONNX, Evaluate, PolicyRefusedError
from .policy_runtime import is_program, read_policy
from .policy_worker import PolicyFailedError, PolicyWorker


@dataclass(frozen=True)
class NetworkLayout:
    """A network's one input and one output, [1, size] float32 each, by their names.

    ``what`` it is, and the ``cure`` for a file that is none.
    """

    what: str
    cure: str
    input: str
    input_size: int
    output: str
    output_size: int


class OnnxNetwork:
    """A network's file, read once and tried with zeros, in a process of its own.

    Raises RobotError: as ``read_policy``, no ONNX, other names or sizes, numbers that are not finite, a network that
    damages or fills its process, or computes without an end.
    """

    def __init__(self, path: str | Path, layout: NetworkLayout) -> None:
        self.path, self._layout = Path(path), layout
        if is_program(self.path):
            raise self._refused("it is a program, and no ONNX network")
        content = read_policy(self.path)
        for name in (layout.input, layout.output):
            if _as_protobuf(name) not in content:
                raise self._refused(f"nothing in it is called {name}")
        try:
            self._worker = PolicyWorker(ONNX, content, layout.input_size, str(path))
        except PolicyFailedError as error:
            raise self._refused(f"it cannot be opened: {error}") from error
        self._evaluate = self._opened()
        self(np.zeros(layout.input_size, np.float32))

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """(output_size,) float32 of ``observation`` (input_size,) float32. Raises RobotError."""
        layout = self._layout
        if observation.shape != (layout.input_size,) or not np.isfinite(observation).all():
            raise RobotError(
                f"the {layout.what} is asked with {observation.size} numbers, or with some that are not finite",
                where=self.path,
                cure=f"Give {layout.input_size} finite ones.",
            )
        try:
            found = self._evaluate(observation)
        except PolicyFailedError as error:
            raise self._refused(f"it failed as it was asked: {error}") from error
        if found.shape != (layout.output_size,):
            raise self._refused(f"it gives {found.size} numbers in place of {layout.output_size}")
        if not np.isfinite(found).all():
            raise self._refused("it gives numbers that are not finite")
        return found

    def _opened(self) -> Evaluate:
        try:
            return self._worker.network()
        except PolicyRefusedError as error:
            raise self._refused(error.what) from error
        except PolicyFailedError as error:
            raise self._refused(f"it cannot be opened: {error}") from error

    def _refused(self, what: str) -> RobotError:
        return RobotError(f"this is no {self._layout.what}: {what}", where=self.path, cure=self._layout.cure)


def _as_protobuf(name: str) -> bytes:
    """How protocol buffers write a name that is a string of fewer than 128 letters: its length before it."""
    return bytes([len(name)]) + name.encode()
