"""Running a policy's network: ONNX through onnxruntime, TorchScript through torch."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from pathlib import Path
from typing import Protocol

import numpy as np

from ...core.errors import RobotError
from .policy_layout import PolicyLayout
from .telemetry import onnxruntime_without_telemetry

_MAX_BYTES = 512 * 1024 * 1024
# In ONNX's protocol buffers: the key of a tensor whose numbers lie in another file.
_EXTERNAL_DATA = b"\n\x08location"
_FLOAT = "tensor(float)"
_TORCHSCRIPT = (".pt", ".pth", ".jit", ".torchscript")


class Network(Protocol):
    """A policy's network; a recurrent one remembers what it was given."""

    def __call__(self, observation: np.ndarray) -> np.ndarray:
        """Raw actions (m,) float32 of an observation (n,) float32."""


class PolicyFile:
    """A policy's file, read once and checked against its layout.

    ``.onnx`` describes a computation. A TorchScript file (``.pt``) is a program that torch
    runs with this user's rights: it is loaded only because a scope names it. Raises
    RobotError: unreadable, tensors in other files, more than one input, sizes other than
    the layout's, actions that are not finite.
    """

    def __init__(self, path: str | Path, layout: PolicyLayout) -> None:
        self.path, self._layout = Path(path), layout
        suffix = self.path.suffix.lower()
        if suffix != ".onnx" and suffix not in _TORCHSCRIPT:
            raise self._error(f"'{suffix}' is no policy", "Give an ONNX file (.onnx) or a TorchScript file (.pt).")
        try:
            if self.path.stat().st_size > _MAX_BYTES:
                raise self._error("the policy is larger than 512 MB", "Give the policy's network alone.")
            self._content = self.path.read_bytes()
        except OSError as error:
            raise self._error("this policy cannot be read", "Check controller.file of the scope.") from error
        self._open = self._onnx if suffix == ".onnx" else self._torchscript
        self._check(self.network())

    def network(self) -> Network:
        """The network as it is before its first observation."""
        return self._open()

    def _check(self, network: Network) -> None:
        layout = self._layout
        try:
            actions = network(np.zeros(layout.observation_size, np.float32))
        except Exception as error:  # torch and onnxruntime raise kinds of their own
            raise self._error(
                f"the network does not take the layout's {layout.observation_size} observations: "
                f"{told_in_a_line(error)}",
                f"Correct observation and history of {layout.where}.",
            ) from error
        if actions.shape != (layout.action_size,):
            raise self._error(
                f"the network gives {actions.size} actions, the layout {layout.action_size}",
                f"Correct joints or action.joints of {layout.where}.",
            )
        if not np.isfinite(actions).all():
            raise self._error("the network's actions are not finite", "Export the policy again.")

    def _onnx(self) -> Network:
        onnxruntime = onnxruntime_without_telemetry()
        if _EXTERNAL_DATA in self._content:
            raise self._error("its tensors lie in other files", "Export the policy as one file.")
        options = onnxruntime.SessionOptions()
        # One thread: rollouts run side by side, and sums keep their order.
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            session = onnxruntime.InferenceSession(self._content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # its exceptions share no base of their own
            raise self._error(
                f"this is no ONNX network: {told_in_a_line(error)}", "Export the policy again."
            ) from error
        inputs = session.get_inputs()
        if len(inputs) != 1 or inputs[0].type != _FLOAT:
            shown = ", ".join(f"{one.name} {one.type}" for one in inputs)
            raise self._error(f"the network's inputs are {shown}", "It has to take one tensor of floats.")
        (name,) = [one.name for one in inputs]
        width = inputs[0].shape[-1] if inputs[0].shape else None
        if isinstance(width, int) and width != self._layout.observation_size:
            raise self._error(
                f"the network takes {width} observations, the layout {self._layout.observation_size}",
                f"Correct observation and history of {self._layout.where}.",
            )
        output = session.get_outputs()[0].name

        def evaluate(observation: np.ndarray) -> np.ndarray:
            (actions,) = session.run([output], {name: observation[None]})
            return np.asarray(actions, np.float32).reshape(-1)

        return evaluate

    def _torchscript(self) -> Network:
        import torch

        try:
            with warnings.catch_warnings():  # torch would rather have policies exported anew
                warnings.simplefilter("ignore", DeprecationWarning)
                module = torch.jit.load(io.BytesIO(self._content), map_location="cpu").eval()
        except Exception as error:  # RuntimeError, and what its reader of archives raises
            raise self._error(
                f"this is no TorchScript file: {told_in_a_line(error)}", "Export it with torch.jit.save."
            ) from error

        def evaluate(observation: np.ndarray) -> np.ndarray:
            # One thread, as above; what else this process computes keeps its own.
            threads = torch.get_num_threads()
            torch.set_num_threads(1)
            try:
                # What the program prints is no result of the command's.
                with torch.inference_mode(), contextlib.redirect_stdout(sys.stderr):
                    actions = module(torch.from_numpy(observation[None]))
            finally:
                torch.set_num_threads(threads)
            if not isinstance(actions, torch.Tensor):
                raise TypeError(f"it gives {type(actions).__name__}, not a tensor")
            return actions.to(torch.float32).numpy().reshape(-1).copy()

        return evaluate

    def _error(self, what: str, cure: str) -> RobotError:
        return RobotError(what, where=self.path, cure=cure)


def told_in_a_line(error: Exception) -> str:
    """The last line of an error of torch or onnxruntime, which says what the others lead up to."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[-1] if lines else type(error).__name__)[:200].rstrip(".")
