"""The elements of a PLY file as arrays, with NumPy alone: Blender's Python reads them too."""

from __future__ import annotations

import io
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from .files import content

_SCALARS = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20
_COUNT = re.compile("[0-9]{1,18}")
_MOST_PROPERTIES = 1024
"""Of all elements; degree 4 has 86."""


@dataclass
class _Element:
    """What the header says of an element; ``unread`` is a line of it that is no scalar property."""

    name: str
    count: int
    fields: list[tuple[str, str]] = field(default_factory=list)
    unread: str = ""


def read_vertices(path: Path) -> np.ndarray:
    """The vertices as a structured array, read-only, with the header's names and types.

    Raises AssetError naming the file and the property or size that is wrong.
    """
    return read_elements(path, ("vertex",))["vertex"]


def read_elements(path: Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Those of the elements ``names`` that the file has, each as ``read_vertices``; it must have vertices."""
    return _elements(content(path), names, path)


def vertex_count(path: Path) -> int:
    """How many vertices the header announces; the rest of the file is not read. Raises AssetError."""
    return _vertex_element(path).count


def vertex_properties(path: Path) -> list[str]:
    """Their scalar properties; otherwise as ``vertex_count``."""
    return [name for name, _ in _vertex_element(path).fields]


def _vertex_element(path: Path) -> _Element:
    header = content(path, _LONGEST_HEADER)
    _, elements, _ = _header(header, path.stat().st_size, path)
    return next(element for element in elements if element.name == "vertex")


def _elements(data: bytes, names: Collection[str], path: Path) -> dict[str, np.ndarray]:
    order, elements, place = _header(data, len(data), path)
    if order != "ascii" and order not in _BYTE_ORDERS:
        raise AssetError(f"the format '{order}' is unknown", where=path, cure="Use binary_little_endian.")
    found: dict[str, np.ndarray] = {}
    for element in elements:
        wanted = element.name in names
        if wanted and element.unread:
            raise AssetError(
                f"the line '{element.unread}' is no scalar property", where=path, cure="Export it as a 3DGS PLY."
            )
        if element.count and (element.unread or (order == "ascii" and not wanted)):
            break  # where the next one starts is not known
        if wanted and order == "ascii":
            found[element.name] = _ascii_rows(data[place:], element, path)
            break
        layout = np.dtype([(name, _BYTE_ORDERS.get(order, "<") + kind) for name, kind in element.fields])
        needed = element.count * layout.itemsize
        if needed > len(data) - place:
            raise _cut_short(element, needed, len(data) - place, path)
        if wanted:
            found[element.name] = np.frombuffer(data, layout, element.count, place)
        place += needed
    if "vertex" not in found:
        first = elements[0].name
        raise AssetError(
            f"the element '{first}' stands before the vertices", where=path, cure="Export the splats alone."
        )
    return found


def _header(data: bytes, file_bytes: int, path: Path) -> tuple[str, list[_Element], int]:
    """The order of the bytes, the elements, and where the first begins."""
    end = data.find(b"end_header", 0, _LONGEST_HEADER)
    if not data.startswith(b"ply") or end < 0:
        raise AssetError("the file is not a PLY", where=path, cure="Give a 3DGS .ply file.")
    order, elements = "", []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        match words[:1]:
            case ["format"]:
                order = words[1] if len(words) > 1 else ""
            case ["element"] if len(words) == 3 and _COUNT.fullmatch(words[2]):
                elements.append(_Element(words[1], int(words[2])))
            case ["element"]:
                raise AssetError(
                    f"the line '{line.strip()}' counts nothing", where=path, cure="Export it as a 3DGS PLY."
                )
            case ["property"] if elements:
                if len(words) == 3 and words[1] in _SCALARS:
                    elements[-1].fields.append((words[2], _SCALARS[words[1]]))
                else:
                    elements[-1].unread = line.strip()
    if sum(len(element.fields) for element in elements) > _MOST_PROPERTIES:
        raise AssetError(f"the header has more than {_MOST_PROPERTIES} properties", where=path, cure="Export it again.")
    vertices = [element for element in elements if element.name == "vertex"]
    usable = len(vertices) == 1 and bool(vertices[0].fields or vertices[0].unread)
    if not usable or any(len(dict(element.fields)) < len(element.fields) for element in elements):
        raise AssetError("the header has no usable vertex element", where=path, cure="Export it as a 3DGS PLY.")
    for element in elements:
        if element.count > file_bytes:  # of which each takes a byte at least
            raise _cut_short(element, element.count, file_bytes, path)
    return order, elements, data.find(b"\n", end) + 1 or len(data)


def _cut_short(element: _Element, needed: int, there: int, path: Path) -> AssetError:
    what = f"{element.count} Gaussians" if element.name == "vertex" else f"the element '{element.name}'"
    return AssetError(
        f"the file is cut short: {what} need{'' if what.endswith('s') else 's'} {needed} bytes and {there} are there",
        where=path,
        cure="Copy or export it again.",
    )


def _ascii_rows(text: bytes, element: _Element, path: Path) -> np.ndarray:
    shape = element.count, len(element.fields)
    needed = 2 * element.count * len(element.fields) - 1  # a digit each, and what parts them
    if len(text) < needed:
        raise _cut_short(element, needed, len(text), path)
    values = np.empty((0, len(element.fields)), np.float32)
    if element.count:
        try:
            values = np.loadtxt(io.BytesIO(text), np.float32, max_rows=element.count, ndmin=2)
        except ValueError as error:
            raise AssetError("the text of the file is damaged", where=path, cure="Export it again.") from error
    if values.shape != shape:
        raise AssetError(f"the file has {values.shape} numbers, not {shape}", where=path, cure="Export it again.")
    layout = np.dtype([(name, "f4") for name, _ in element.fields])
    return np.ascontiguousarray(values).reshape(shape).view(layout)[:, 0]
