"""Policies of one affine layer, written by hand: as ONNX's protocol buffers, and as TorchScript."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2sego_blender.config.trusted_programs import Program, trust


def onnx_policy(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """Write actions = observation @ ``weight`` (n, m) + ``bias`` (m,)."""
    inputs, outputs = weight.shape
    node = b"".join(field(1, name) for name in (b"obs", b"weight", b"bias"))
    node += field(2, b"actions") + field(4, b"Gemm")
    graph = field(1, node) + field(2, b"policy")
    graph += field(5, tensor(b"weight", weight)) + field(5, tensor(b"bias", bias))
    path.write_bytes(onnx_model(graph, inputs, outputs))
    return path


def onnx_model(graph: bytes, inputs: int, outputs: int) -> bytes:
    """The file of a graph from ``obs`` (1, inputs) to ``actions`` (1, outputs)."""
    graph += field(11, value(b"obs", (1, inputs))) + field(12, value(b"actions", (1, outputs)))
    return number(1, 8) + field(7, graph) + field(8, number(2, 13))


def torchscript_policy(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """The same as TorchScript."""
    import torch

    layer = torch.nn.Linear(*weight.shape)
    with torch.no_grad():
        layer.weight[:] = torch.from_numpy(weight.T)
        layer.bias[:] = torch.from_numpy(bias)
    torch.jit.script(layer).save(str(path))
    return path


def counting_policy(path: Path) -> Path:
    """TorchScript that answers with how often it was asked, (1, 2)."""
    import torch

    class Counting(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.register_buffer("count", torch.zeros(1))

        def forward(self, observation: torch.Tensor) -> torch.Tensor:
            self.count += 1.0
            return self.count.expand(1, 2)

    torch.jit.script(Counting()).save(str(path))
    return path


def trusted(path: Path) -> Path:
    """The file, which a person has trusted from now on."""
    trust(Program.of(path.name, path.read_bytes()))
    return path


def tensor(name: bytes, values: np.ndarray) -> bytes:
    dimensions = b"".join(number(1, size) for size in values.shape)
    return dimensions + number(2, 1) + field(8, name) + field(9, values.astype("<f4").tobytes())


def value(name: bytes, shape: tuple[int, ...], kind: int = 1) -> bytes:
    dimensions = b"".join(field(1, number(1, size)) for size in shape)
    return field(1, name) + field(2, field(1, number(1, kind) + field(2, dimensions)))


def field(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def number(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])
