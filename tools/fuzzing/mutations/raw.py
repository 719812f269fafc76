"""Changes of bytes, whatever they mean."""

from __future__ import annotations

import struct
from random import Random

_WHOLE = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1)
_REAL = (float("nan"), float("inf"), -float("inf"), 0.0, -1.0, 1e38, -1e38, 1e-45, 1e308)
_LONGEST = 64


def changed_bytes(data: bytes, rng: Random) -> tuple[bytes, str]:
    """The bytes with one change to them, and its name."""
    return rng.choice(_CHANGES)(data, rng)


def _place(data: bytes, rng: Random, length: int = 1) -> int:
    """Headers lie at the beginning and directories at the end: half the changes are made there."""
    last = max(len(data) - length, 0)
    kind = rng.random()
    if kind < 0.3:
        return min(rng.randrange(256), last)
    if kind < 0.45:
        return max(last - rng.randrange(256), 0)
    return rng.randint(0, last)


def _span(data: bytes, rng: Random) -> tuple[int, int]:
    begin = _place(data, rng)
    return begin, min(len(data), begin + rng.randint(1, _LONGEST if rng.random() < 0.7 else len(data) or 1))


def _written(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


def _bits(data: bytes, rng: Random) -> tuple[bytes, str]:
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 40))):
        if found:
            found[_place(data, rng)] ^= 1 << rng.randrange(8)
    return bytes(found), "bits"


def _noise(data: bytes, rng: Random) -> tuple[bytes, str]:
    begin, end = _span(data, rng)
    return data[:begin] + rng.randbytes(end - begin) + data[end:], "noise"


def _cut(data: bytes, rng: Random) -> tuple[bytes, str]:
    return data[: _place(data, rng)] if rng.random() < 0.95 else b"", "cut off"


def _doubled(data: bytes, rng: Random) -> tuple[bytes, str]:
    begin, end = _span(data, rng)
    return data[:end] + data[begin:end] * rng.choice((1, 1, 2, 100)) + data[end:], "doubled"


def _deleted(data: bytes, rng: Random) -> tuple[bytes, str]:
    begin, end = _span(data, rng)
    return data[:begin] + data[end:], "deleted"


def _swapped(data: bytes, rng: Random) -> tuple[bytes, str]:
    (a, b), (c, d) = sorted((_span(data, rng), _span(data, rng)))
    b = min(b, c)
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:], "swapped"


def _whole_number(data: bytes, rng: Random) -> tuple[bytes, str]:
    value, letter = rng.choice(_WHOLE), rng.choice("BHIQ")
    order = rng.choice("<>")
    bits = 8 * struct.calcsize(letter)
    new = struct.pack(order + letter, value & ((1 << bits) - 1))
    return _written(data, _place(data, rng, len(new)), new), f"u{bits}"


def _real_number(data: bytes, rng: Random) -> tuple[bytes, str]:
    value, letter = rng.choice(_REAL), rng.choice("fd")
    if letter == "f" and abs(value) == 1e308:
        value = 3.4e38
    new = struct.pack(rng.choice("<<>") + letter, value)
    at = _place(data, rng, len(new))
    return _written(data, at - at % rng.choice((1, 4)), new), f"f{8 * len(new)} {value}"


def _filled(data: bytes, rng: Random) -> tuple[bytes, str]:
    begin, end = _span(data, rng)
    return data[:begin] + bytes([rng.choice((0, 0xFF, 0x20, 0x41))]) * (end - begin) + data[end:], "filled"


_CHANGES = (_bits, _noise, _cut, _doubled, _deleted, _swapped, _whole_number, _real_number, _real_number, _filled)
