"""Changes of ONNX networks: bytes, and nodes that ask for more than any machine has."""

from __future__ import annotations

import struct
from random import Random

from .raw import changed_bytes


def changed_onnx(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A network with its bytes changed, or one that is made to ask for much."""
    if rng.random() < 0.9:
        return changed_bytes(data, rng)
    return rng.choice(
        (
            (_network(_constant(1 << 62)), "a constant of 2^62"),
            (_network(_constant(1 << 31)), "a constant of 2^31"),
            (_network(_constant(rng.randrange(1 << 28))), "a large constant"),
            (_network(_loop(1 << 62)), "a loop of 2^62"),
        )
    )


def _network(nodes: bytes) -> bytes:
    graph = nodes + _field(2, b"policy") + _field(11, _value(b"obs", 4)) + _field(12, _value(b"actions", 2))
    return _number(1, 8) + _field(7, graph) + _field(8, _number(2, 13))


def _constant(size: int) -> bytes:
    """A constant of so many zeros, summed up."""
    value = _field(1, b"value") + _field(5, _tensor(b"v", 7, struct.pack("<q", size))) + _number(20, 4)
    shape = _field(2, b"shape") + _field(4, b"Constant") + _field(5, value)
    filled = _field(1, b"shape") + _field(2, b"many") + _field(4, b"ConstantOfShape")
    summed = _field(1, b"many") + _field(2, b"actions") + _field(4, b"ReduceSum")
    return _field(1, shape) + _field(1, filled) + _field(1, summed)


def _loop(times: int) -> bytes:
    """A loop that runs so often and does nothing."""
    count = _field(1, b"value") + _field(5, _tensor(b"n", 7, struct.pack("<q", times), one=True)) + _number(20, 4)
    goes_on = _field(1, b"value") + _field(5, _tensor(b"c", 9, b"\1", one=True)) + _number(20, 4)
    same = [(b"c_in", b"c_out"), (b"x_in", b"x_out")]
    body = b"".join(_field(1, _field(1, a) + _field(2, b) + _field(4, b"Identity")) for a, b in same)
    body += _field(2, b"body")
    body += b"".join(_field(11, _value(n, None, k)) for n, k in ((b"i", 7), (b"c_in", 9), (b"x_in", 1)))
    body += b"".join(_field(12, _value(n, None, k)) for n, k in ((b"c_out", 9), (b"x_out", 1)))
    attribute = _field(1, b"body") + _field(6, body) + _number(20, 5)
    loop = b"".join(_field(1, name) for name in (b"n", b"c", b"obs")) + _field(2, b"actions")
    loop += _field(4, b"Loop") + _field(5, attribute)
    times_of_it = _field(2, b"n") + _field(4, b"Constant") + _field(5, count)
    always = _field(2, b"c") + _field(4, b"Constant") + _field(5, goes_on)
    return b"".join(_field(1, node) for node in (times_of_it, always, loop))


def _tensor(name: bytes, kind: int, values: bytes, one: bool = False) -> bytes:
    return (b"" if one else _number(1, 1)) + _number(2, kind) + _field(8, name) + _field(9, values)


def _value(name: bytes, size: int | None, kind: int = 1) -> bytes:
    shape = b"" if size is None else _field(2, _field(1, _number(1, 1)) + _field(1, _number(1, size)))
    return _field(1, name) + _field(2, _field(1, _number(1, kind) + shape))


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
