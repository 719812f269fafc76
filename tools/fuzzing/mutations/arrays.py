"""Changes of NumPy's files: what their arrays hold, what their headers say, and how they are packed."""

from __future__ import annotations

import io
import struct
import zipfile
from functools import cache
from random import Random

import numpy as np

from .raw import changed_bytes

_DTYPES = ("f2", "f4", "f8", ">f8", "c16", "?", "i1", "u1", "i4", "i8", "u8", "U3", "S4", "M8[s]")
_DESCRIPTIONS = (
    "'|O'",
    "'<U-1'",
    "'<U-73741824'",
    "'<f3'",
    "'V8'",
    "[('a','<f8')]",
    "('<f8', (4,))",
    "'<U0'",
    "5",
    "'",
)
_SHAPES = ("(10000000000,)", "(-1,)", "(1, -3)", "(1099511627776, 3)", "(0,)", "()", "(3.5,)", "('a',)", "(" * 300)
_BAD = (np.nan, np.inf, -np.inf, 1e308, 1e38, -1.0, 0.0, 0.5, 1e-320, 2.0**31, 2.0**63, -(2.0**63))


def changed_npz(data: bytes, rng: Random) -> tuple[bytes, str]:
    """An ``.npz`` with a few changes to it, and their names."""
    if rng.random() < 0.15:
        return changed_bytes(data, rng)
    members, told = _members(data), []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        at = rng.randrange(len(members))
        name, content = members[at]
        if rng.random() < 0.15:
            told.append(_rename(members, at, rng))
        else:
            content, change = changed_npy(content, rng)
            members[at] = (name, content)
            told.append(f"{name}: {change}")
    compression = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    if rng.random() < 0.02:
        name, compression = rng.choice((members[0][0], "bomb.npy")), zipfile.ZIP_DEFLATED
        members = [(name, _bomb()), *(one for one in members if one[0] != name)]
        told.append("bomb")
    packed = _packed(members, compression)
    if rng.random() < 0.08:
        packed, change = _lying(packed, rng)
        told.append(change)
    return packed, "; ".join(told)


def changed_npy(data: bytes, rng: Random) -> tuple[bytes, str]:
    """An ``.npy`` with one change to it, and its name."""
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception:  # it was changed before
        return changed_bytes(data, rng)
    way = rng.randrange(12)
    if way < 5:
        return _saved(*_values(array, rng))
    if way < 7:
        return _shape(array, rng)
    if way == 7:
        dtype = rng.choice(_DTYPES)
        with np.errstate(all="ignore"):
            return _saved(array.astype(dtype) if array.dtype.kind in "biuf" else array.astype(str), f"dtype {dtype}")
    if way == 8:
        return _header(data, rng)
    if way == 9:
        return _saved(np.array([{"a": 1}, None], dtype=object), "pickled", pickled=True)
    if way == 10:
        return rng.choice((b"", b"\x93NUMPY", data[:60], b"not an array")), "no array"
    return changed_bytes(data, rng)


def _members(data: bytes) -> list[tuple[str, bytes]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def _packed(members: list[tuple[str, bytes]], compression: int) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression, compresslevel=1) as archive:
        for name, content in members:
            with archive.open(name or "a", "w") as file:
                file.write(content)
    return stream.getvalue()


def _rename(members: list[tuple[str, bytes]], at: int, rng: Random) -> str:
    name, content = members[at]
    match rng.randrange(4):
        case 0:
            if len(members) > 1:
                del members[at]
            return f"{name} gone"
        case 1:
            members.append(("../../outside/secret.npy", content))
            return "a name outside"
        case 2:
            members[at] = (members[(at + 1) % len(members)][0] + "x", content)
            return f"{name} renamed"
        case _:
            members[at] = (name, members[rng.randrange(len(members))][1])
            return f"{name} is another"


def _values(array: np.ndarray, rng: Random) -> tuple[np.ndarray, str]:
    if array.dtype.kind not in "iufb" or not array.size:
        return array[..., None], "an axis more"
    new = np.array(array)
    flat = new.reshape(-1)
    bad = rng.choice(_BAD)
    with np.errstate(all="ignore"):
        match rng.randrange(5):
            case 0 | 1:
                flat[rng.randrange(flat.size)] = np.array(bad).astype(array.dtype)
            case 2:
                flat[:] = np.array(bad).astype(array.dtype)
            case 3:
                new = (
                    -new[::-1] if array.dtype.kind in "if" and array.ndim else ~new if array.dtype.kind == "b" else new
                )
            case _:
                new = np.frombuffer(rng.randbytes(new.nbytes), array.dtype).reshape(array.shape)
    return new, f"values {bad}"


def _shape(array: np.ndarray, rng: Random) -> tuple[bytes, str]:
    ways = (array.ravel(), array[None], array[..., None], array[:0] if array.ndim else array, array.T)
    more = (array[:-1], np.concatenate([array, array[:1]])) if array.ndim else (np.array([array, array]),)
    return _saved(rng.choice(ways + more), "shape")


def _header(data: bytes, rng: Random) -> tuple[bytes, str]:
    end = 10 + struct.unpack("<H", data[8:10])[0]
    header = data[10:end].decode("latin-1")
    if rng.random() < 0.5:
        value = rng.choice(_SHAPES)
        header = header[: header.index("(")] + value + header[header.index(")", header.index("(")) + 1 :]
    else:
        value = rng.choice(_DESCRIPTIONS)
        begin = header.index("'descr':") + 8
        header = f"{header[:begin]} {value}{header[header.index(', ', begin) :]}"
    if rng.random() < 0.1:
        header, value = header.replace("}", ""), "no end"
    coded = header.encode("latin-1")
    return data[:8] + struct.pack("<H", len(coded)) + coded + data[end:], f"header {value[:20]}"


def _lying(packed: bytes, rng: Random) -> tuple[bytes, str]:
    """Other sizes, methods or flags in one of the archive's entries."""
    signature, fields = rng.choice(
        ((b"PK\x01\x02", (8, 10, 16, 20, 24, 28, 42)), (b"PK\x03\x04", (6, 8, 14, 18, 22, 26)))
    )
    places = [at for at in range(len(packed)) if packed.startswith(signature, at)]
    if not places:
        return packed, ""
    at = rng.choice(places) + rng.choice(fields)
    value = rng.choice((0, 1, 9, 99, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF))
    return packed[:at] + struct.pack("<I", value) + packed[at + 4 :], "a size that lies"


def _saved(array: np.ndarray, name: str, pickled: bool = False) -> tuple[bytes, str]:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asanyarray(array), allow_pickle=pickled)
    return stream.getvalue(), name


@cache
def _bomb() -> bytes:
    return _saved(np.zeros(30_000_000), "")[0]
