"""Opening a policy's network: ONNX with onnxruntime, TorchScript with torch, on one thread.

Called in the process of ``policy_worker`` alone.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .telemetry import onnxruntime_without_telemetry

ONNX, TORCHSCRIPT = "onnx", "torchscript"

Evaluate = Callable[[np.ndarray], np.ndarray]
"""Raw actions (m,) float32 of an observation (n,) float32; a recurrent network remembers what it was given.

One that sees takes the bytes (n,) uint8 of a picture and after them those of its float32 numbers.
"""

SEEING = {"rgb": "tensor(uint8)", "proprio": "tensor(float)", "state": "tensor(float)"}
"""Inputs of a network that sees and remembers, in this order."""

SEEING_OUTPUTS = ("action", "next_state")
"""Its outputs."""

_FLOAT = "tensor(float)"
_MOST_STATE = 1 << 20


class PolicyRefusedError(Exception):
    """A network that does not fit; ``cure`` says what to do."""

    def __init__(self, what: str, cure: str = "Export the policy again.") -> None:
        self.what, self.cure = what, cure
        super().__init__(what)


def opener(
    kind: str, observations: int, layout: str, picture: Sequence[int] | None = None
) -> Callable[[bytes], Evaluate]:
    """What opens a file's content; it imports all that it needs first.

    ``picture``, rows, columns and channels, is what a network sees besides so many ``observations``. Opening
    raises PolicyRefusedError: no such network, other inputs, another size than the file ``layout`` says.
    """
    if picture is not None:
        return _seeing_opener((1, *picture), observations)
    return _onnx_opener(observations, layout) if kind == ONNX else _torchscript_opener()


def _onnx_opener(observations: int, layout: str) -> Callable[[bytes], Evaluate]:
    onnxruntime = onnxruntime_without_telemetry()

    def opened(content: bytes) -> Evaluate:
        session = _session(onnxruntime, content)
        inputs = session.get_inputs()
        if len(inputs) != 1 or inputs[0].type != _FLOAT:
            shown = ", ".join(f"{one.name} {one.type}" for one in inputs)[:200]
            raise PolicyRefusedError(f"the network's inputs are {shown}", "It has to take one tensor of floats.")
        name, shape = inputs[0].name, inputs[0].shape
        width = shape[-1] if shape else None
        if isinstance(width, int) and width != observations:
            raise PolicyRefusedError(
                f"the network takes {width} observations, the layout {observations}",
                f"Declare the layout that it was trained with: observation and history of {layout} are others.",
            )
        output = session.get_outputs()[0].name

        def evaluate(observation: np.ndarray) -> np.ndarray:
            (actions,) = session.run([output], {name: observation[None]})
            return np.asarray(actions, np.float32).reshape(-1)

        return evaluate

    return opened


def _session(onnxruntime: Any, content: bytes) -> Any:
    options = onnxruntime.SessionOptions()
    # One thread: rollouts run side by side, and sums keep their order.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # its exceptions share no base of their own
        raise PolicyRefusedError(f"this is no ONNX network: {told_in_a_line(error)}") from error


def _seeing_opener(picture: tuple[int, ...], observations: int) -> Callable[[bytes], Evaluate]:
    onnxruntime = onnxruntime_without_telemetry()
    pixels = math.prod(picture)

    def opened(content: bytes) -> Evaluate:
        session = _session(onnxruntime, content)
        inputs = {one.name: one for one in session.get_inputs()}
        outputs = [one.name for one in session.get_outputs()]
        if {name: one.type for name, one in inputs.items()} != SEEING or not set(SEEING_OUTPUTS) <= set(outputs):
            shown = ", ".join(f"{one.name} {one.type}" for one in inputs.values())[:200]
            raise PolicyRefusedError(
                f"the network takes {shown} and gives {', '.join(outputs)[:200]}",
                f"It has to take {', '.join(SEEING)} and give {', '.join(SEEING_OUTPUTS)}.",
            )
        size = inputs["state"].shape[-1]
        if not isinstance(size, int) or not 0 < size <= _MOST_STATE:
            raise PolicyRefusedError(f"the network's state has the size {size}", "Export it with a fixed size.")
        wanted = {"rgb": picture, "proprio": (1, observations), "state": (1, size)}
        for name, shape in wanted.items():
            given = inputs[name].shape
            if len(given) != len(shape) or any(
                isinstance(a, int) and a != b for a, b in zip(given, shape, strict=True)
            ):
                raise PolicyRefusedError(f"the network's {name} is {given}, not {list(shape)}", "Export it so.")
        state = np.zeros((1, size), np.float32)

        def evaluate(observation: np.ndarray) -> np.ndarray:
            nonlocal state
            rgb, proprio = observation[:pixels].reshape(picture), observation[pixels:].view("<f4")[None]
            given = {"rgb": rgb, "proprio": proprio, "state": state}
            action, after = session.run(list(SEEING_OUTPUTS), given)
            if after.shape != state.shape or not np.isfinite(after).all():
                raise ValueError("its next state is not finite, or of another size")
            state = after
            return np.asarray(action, np.float32).reshape(-1)

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
