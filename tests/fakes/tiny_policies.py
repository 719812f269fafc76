"""Policies of one affine layer, written by hand: as ONNX's protocol buffers, and as TorchScript."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch


def onnx_policy(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """Write actions = observation @ ``weight`` (n, m) + ``bias`` (m,)."""
    inputs, outputs = weight.shape
    node = b"".join(_field(1, name) for name in (b"obs", b"weight", b"bias"))
    node += _field(2, b"actions") + _field(4, b"Gemm")
    graph = _field(1, node) + _field(2, b"policy")
    graph += _field(5, _tensor(b"weight", weight)) + _field(5, _tensor(b"bias", bias))
    graph += _field(11, _value(b"obs", (1, inputs))) + _field(12, _value(b"actions", (1, outputs)))
    path.write_bytes(_number(1, 8) + _field(7, graph) + _field(8, _number(2, 13)))
    return path


def torchscript_policy(path: Path, weight: np.ndarray, bias: np.ndarray) -> Path:
    """The same as TorchScript."""
    layer = torch.nn.Linear(*weight.shape)
    with torch.no_grad():
        layer.weight[:] = torch.from_numpy(weight.T)
        layer.bias[:] = torch.from_numpy(bias)
    torch.jit.script(layer).save(str(path))
    return path


def _tensor(name: bytes, values: np.ndarray) -> bytes:
    dimensions = b"".join(_number(1, size) for size in values.shape)
    return dimensions + _number(2, 1) + _field(8, name) + _field(9, values.astype("<f4").tobytes())


def _value(name: bytes, shape: tuple[int, ...]) -> bytes:
    dimensions = b"".join(_field(1, _number(1, size)) for size in shape)
    return _field(1, name) + _field(2, _field(1, _number(1, 1) + _field(2, dimensions)))


def _field(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _number(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])
