"""Opening a policy's network: ONNX with onnxruntime, TorchScript with torch, on one thread.

Called in the process of ``policy_worker`` alone.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable

import numpy as np

from .telemetry import onnxruntime_without_telemetry

ONNX, TORCHSCRIPT = "onnx", "torchscript"

Evaluate = Callable[[np.ndarray], np.ndarray]
"""Raw actions (m,) float32 of an observation (n,) float32; a recurrent network remembers what it was given."""

_FLOAT = "tensor(float)"


class PolicyRefusedError(Exception):
    """A network that does not fit; ``cure`` says what to do."""

    def __init__(self, what: str, cure: str = "Export the policy again.") -> None:
        self.what, self.cure = what, cure
        super().__init__(what)


def opener(kind: str, observations: int, layout: str) -> Callable[[bytes], Evaluate]:
    """What opens a file's content; it imports all that it needs first.

    Opening raises PolicyRefusedError: no such network, more than one input, another size than the
    ``observations`` of the file ``layout``.
    """
    return _onnx_opener(observations, layout) if kind == ONNX else _torchscript_opener()


def _onnx_opener(observations: int, layout: str) -> Callable[[bytes], Evaluate]:
    onnxruntime = onnxruntime_without_telemetry()

    def opened(content: bytes) -> Evaluate:
        options = onnxruntime.SessionOptions()
        # One thread: rollouts run side by side, and sums keep their order.
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # its exceptions share no base of their own
            raise PolicyRefusedError(f"this is no ONNX network: {told_in_a_line(error)}") from error
        inputs = session.get_inputs()
        if len(inputs) != 1 or inputs[0].type != _FLOAT:
            shown = ", ".join(f"{one.name} {one.type}" for one in inputs)[:200]
            raise PolicyRefusedError(f"the network's inputs are {shown}", "It has to take one tensor of floats.")
        name, shape = inputs[0].name, inputs[0].shape
        width = shape[-1] if shape else None
        if isinstance(width, int) and width != observations:
            raise PolicyRefusedError(
                f"the network takes {width} observations, the layout {observations}",
                f"Correct observation and history of {layout}.",
            )
        output = session.get_outputs()[0].name

        def evaluate(observation: np.ndarray) -> np.ndarray:
            (actions,) = session.run([output], {name: observation[None]})
            return np.asarray(actions, np.float32).reshape(-1)

        return evaluate

    return opened


def _torchscript_opener() -> Callable[[bytes], Evaluate]:
    import torch

    torch.set_num_threads(1)

    def opened(content: bytes) -> Evaluate:
        try:
            with warnings.catch_warnings():  # torch would rather have policies exported anew
                warnings.simplefilter("ignore", DeprecationWarning)
                module = torch.jit.load(io.BytesIO(content), map_location="cpu").eval()
        except Exception as error:  # RuntimeError, and what its reader of archives raises
            raise PolicyRefusedError(
                f"this is no TorchScript file: {told_in_a_line(error)}", "Export it with torch.jit.save."
            ) from error

        def evaluate(observation: np.ndarray) -> np.ndarray:
            with torch.inference_mode():
                actions = module(torch.from_numpy(observation[None].copy()))
            if not isinstance(actions, torch.Tensor):
                raise TypeError(f"it gives {type(actions).__name__}, not a tensor")
            return actions.to(torch.float32).numpy().reshape(-1)

        return evaluate

    return opened


def told_in_a_line(error: Exception) -> str:
    """The last line of an error of torch or onnxruntime, which says what the others lead up to."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[-1] if lines else type(error).__name__)[:200].rstrip(".")
