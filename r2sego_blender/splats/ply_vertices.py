"""The vertex element of a PLY file as an array, with NumPy alone: Blender's Python reads it too."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from ..errors import AssetError

_SCALARS = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20
_VERTICES = re.compile(rb"^element vertex (\d+)\s*$", re.MULTILINE)


def read_vertices(path: Path) -> np.ndarray:
    """The vertices as a structured array, read-only, with the header's names and types.

    Raises AssetError naming the file and the property or size that is wrong.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise AssetError("the splat file cannot be read", where=path, cure="Check the path.") from error
    return _vertices(data, path)


def vertex_count(path: Path) -> int:
    """How many vertices the header announces; the rest of the file is not read. Raises AssetError."""
    try:
        with path.open("rb") as file:
            header = file.read(_LONGEST_HEADER)
    except OSError as error:
        raise AssetError("the splat file cannot be read", where=path, cure="Check the path.") from error
    found = _VERTICES.search(header[: max(0, header.find(b"end_header"))])
    if found is None:
        raise AssetError("the file is not a PLY", where=path, cure="Give a 3DGS .ply file.")
    return int(found[1])


def _vertices(data: bytes, path: Path) -> np.ndarray:
    """The vertex element as a structured array."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise AssetError("the file is not a PLY", where=path, cure="Give a 3DGS .ply file.")
    body = data.find(b"\n", end) + 1
    order, count, fields = "", None, []
    element = ""
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        match words[:1]:
            case ["format"]:
                order = words[1] if len(words) > 1 else ""
            case ["element"] if len(words) == 3 and words[2].isdigit():
                element = words[1]
                if element == "vertex":
                    count = int(words[2])
                elif count is None and int(words[2]) > 0:
                    raise AssetError(
                        f"the element '{element}' stands before the vertices",
                        where=path, cure="Export the splats alone.",
                    )  # fmt: skip
            case ["property"] if element == "vertex":
                if len(words) != 3 or words[1] not in _SCALARS:
                    raise AssetError(
                        f"the line '{line.strip()}' is no scalar property",
                        where=path,
                        cure="Export it as a 3DGS PLY.",
                    )
                fields.append((words[2], _SCALARS[words[1]]))
    if count is None or not fields or len({name for name, _ in fields}) < len(fields):
        raise AssetError(
            "the header has no usable vertex element", where=path, cure="Export it as a 3DGS PLY."
        )
    if order == "ascii":
        return _ascii_vertices(data[body:], count, fields, path)
    if order not in _BYTE_ORDERS:
        raise AssetError(f"the format '{order}' is unknown", where=path, cure="Use binary_little_endian.")
    layout = np.dtype([(name, _BYTE_ORDERS[order] + kind) for name, kind in fields])
    if len(data) - body < count * layout.itemsize:
        raise AssetError(
            f"the file is cut short: {count} Gaussians need {count * layout.itemsize} bytes "
            f"and {len(data) - body} are there",
            where=path, cure="Copy or export it again.",
        )  # fmt: skip
    return np.frombuffer(data, layout, count, body)


def _ascii_vertices(text: bytes, count: int, fields: list[tuple[str, str]], path: Path) -> np.ndarray:
    layout = np.dtype([(name, "f4") for name, _ in fields])
    try:
        values = np.loadtxt(io.BytesIO(text), np.float32, max_rows=count, ndmin=2)
    except ValueError as error:
        raise AssetError("the text of the file is damaged", where=path, cure="Export it again.") from error
    if values.shape != (count, len(fields)) and count > 0:
        raise AssetError(
            f"the file has {values.shape} numbers, not {(count, len(fields))}",
            where=path,
            cure="Export it again.",
        )
    return np.ascontiguousarray(values).reshape(count, len(fields)).view(layout)[:, 0]
