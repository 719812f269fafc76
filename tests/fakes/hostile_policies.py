"""Policies that ask for what no policy needs: all memory, no end, other files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tiny_policies import field, number, onnx_model, tensor, value

HUGE = 2**62


def _node(kind: bytes, inputs: tuple[bytes, ...], outputs: tuple[bytes, ...], attributes: bytes = b"") -> bytes:
    named = b"".join(field(1, name) for name in inputs) + b"".join(field(2, name) for name in outputs)
    return field(1, named + field(4, kind) + attributes)


def _integers(name: bytes, values: list[int]) -> bytes:
    return number(1, len(values)) + number(2, 7) + field(8, name) + field(9, np.array(values, "<i8").tobytes())


OBSERVATIONS = 5


def constant_of_shape(size: int, observations: int = OBSERVATIONS) -> bytes:
    """An ONNX policy of (1, observations) -> (1, 2) that makes a constant of ``size`` floats."""
    nodes = _node(b"ConstantOfShape", (b"shape",), (b"large",))
    nodes += _node(b"ReduceSum", (b"large",), (b"sum",)) + _node(b"Add", (b"affine", b"sum"), (b"actions",))
    return _around(nodes, field(5, _integers(b"shape", [size])), observations)


def expanded(size: int) -> bytes:
    """One that repeats its observation ``size`` times."""
    nodes = _node(b"Expand", (b"obs", b"shape"), (b"large",))
    nodes += _node(b"ReduceSum", (b"large",), (b"sum",)) + _node(b"Add", (b"affine", b"sum"), (b"actions",))
    return _around(nodes, field(5, _integers(b"shape", [size, 1, OBSERVATIONS])))


def looping(trips: int, observations: int = OBSERVATIONS) -> bytes:
    """One that adds 1 to its actions so often."""
    body = _node(b"Identity", (b"going",), (b"on",)) + _node(b"Add", (b"carried", b"one"), (b"next",))
    body += field(2, b"body") + field(11, value(b"trip", (), 7)) + field(11, value(b"going", (), 9))
    body += field(11, value(b"carried", (1, 2))) + field(12, value(b"on", (), 9)) + field(12, value(b"next", (1, 2)))
    attribute = field(5, field(1, b"body") + field(6, body) + number(20, 5))
    nodes = _node(b"Loop", (b"trips", b"", b"affine"), (b"actions",), attribute)
    known = number(2, 7) + field(8, b"trips") + field(9, np.array([trips], "<i8").tobytes())
    return _around(nodes, field(5, known) + field(5, tensor(b"one", np.ones((1, 2)))), observations)


def elsewhere(place: bytes, key: bytes = b"\n\x08location") -> bytes:
    """One whose weights lie in another file."""
    known = number(1, 5) + number(1, 2) + number(2, 1) + field(8, b"weight")
    known += field(13, key + field(2, place)) + number(14, 1)
    node = _node(b"Gemm", (b"obs", b"weight"), (b"actions",))
    return onnx_model(node + field(2, b"policy") + field(5, known), 5, 2)


def of_many_dimensions() -> bytes:
    """One with a constant that says it is larger than the file."""
    known = b"".join(number(1, 2**31) for _ in range(8)) + number(2, 1) + field(8, b"weight") + field(9, b"1234")
    node = _node(b"Gemm", (b"obs", b"weight"), (b"actions",))
    return onnx_model(node + field(2, b"policy") + field(5, known), 5, 2)


def _around(nodes: bytes, constants: bytes, observations: int = OBSERVATIONS) -> bytes:
    graph = _node(b"Gemm", (b"obs", b"weight"), (b"affine",)) + nodes + field(2, b"policy")
    graph += field(5, tensor(b"weight", np.ones((observations, 2)))) + constants
    return onnx_model(graph, observations, 2)


def damaged_storage(policy: bytes) -> bytes:
    """A TorchScript archive whose tensors' numbers are cut off, in an archive that is whole."""
    import io
    import zipfile

    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(policy)) as source, zipfile.ZipFile(made, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, content[: len(content) // 3] if "/data/" in name else content)
    return made.getvalue()


def torchscript(path: Path, body: str) -> Path:
    """A TorchScript policy that does this before it answers with its first two observations."""
    import torch

    module = torch.jit.script(type("Hostile", (torch.nn.Module,), {})())
    module.define(f"def forward(self, x):\n    {body}\n    return x[:, :2]\n")
    module.save(str(path))
    return path
