"""Changes of PNG images: sizes and kinds of pixels with a right checksum, chunks, and what unpacks to much."""

from __future__ import annotations

import struct
import zlib
from functools import cache
from random import Random

from .raw import changed_bytes

_SIDES = (0, 1, 2, 5, 1000, 16385, 20_000, 40_000, 65_536, 200_000, 1 << 20, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)


def changed_png(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A PNG with one change to it, and its name."""
    way = rng.random()
    if way < 0.35:
        return changed_bytes(data, rng)
    chunks = _chunks(data)
    if way < 0.55:
        head = bytearray(chunks[0][1])
        width, height = rng.choice(_SIDES), rng.choice(_SIDES)
        if rng.random() < 0.5:
            width = struct.unpack(">I", head[:4])[0]
        head[:8] = struct.pack(">II", width, height)
        chunks[0] = (b"IHDR", bytes(head))
        return _png(chunks), f"{width}x{height}"
    if way < 0.65:
        head = bytearray(chunks[0][1])
        head[8 + rng.randrange(5)] = rng.choice((0, 1, 2, 3, 4, 6, 7, 8, 16, 255))
        chunks[0] = (b"IHDR", bytes(head))
        return _png(chunks), "kind of pixels"
    if way < 0.66:
        return _bomb(), "13000x13000"
    at = rng.randrange(len(chunks))
    name, content = chunks[at]
    if way < 0.8:
        content, told = changed_bytes(content, rng)
        chunks[at] = (name, content)
        return _png(chunks), f"{name.decode('latin-1')}: {told}"
    if way < 0.9:
        extra = rng.choice(
            (
                (b"iCCP", b"a\0\0" + zlib.compress(rng.randbytes(300))),
                (b"iCCP", b"a\0\0" + _packed_zeros()),
                (b"zTXt", b"a\0\0" + _packed_zeros()),
                (b"tRNS", rng.randbytes(6)),
                (b"gAMA", struct.pack(">I", 0)),
                (b"eXIf", b"MM\0*\0\0\0\x08" + rng.randbytes(40)),
                (
                    b"eXIf",
                    b"MM\0*\0\0\0\x08\0\1\x01\x12\0\3\0\0\0\1" + struct.pack(">H", rng.randrange(12)) + b"\0" * 6,
                ),
                (b"PLTE", rng.randbytes(9)),
                (b"acTL", struct.pack(">II", 0xFFFFFFFF, 0)),
            )
        )
        chunks.insert(1, extra)
        return _png(chunks), f"with {extra[0].decode()}"
    chunks[at : at + 1] = rng.choice(([], [chunks[at]] * 2, [chunks[rng.randrange(len(chunks))]]))
    return _png(chunks), "chunks"


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], 8
    while at + 8 <= len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        found.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += size + 12
    return found


def _png(chunks: list[tuple[bytes, bytes]]) -> bytes:
    parts = [b"\x89PNG\r\n\x1a\n"]
    for name, content in chunks:
        parts += [struct.pack(">I", len(content)), name, content, struct.pack(">I", zlib.crc32(name + content))]
    return b"".join(parts)


@cache
def _packed_zeros(count: int = 200 << 20) -> bytes:
    packer, piece = zlib.compressobj(1), bytes(1 << 20)
    parts = [packer.compress(piece) for _ in range(count >> 20)]
    return b"".join([*parts, packer.compress(piece[: count % (1 << 20)]), packer.flush()])


@cache
def _bomb() -> bytes:
    side = 13_000
    pixels = _packed_zeros(side * (3 * side + 1))
    return _png([(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)), (b"IDAT", pixels), (b"IEND", b"")])
