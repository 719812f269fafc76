"""The points of a COLMAP model (points3D.bin or points3D.txt): positions and colours alone."""

from __future__ import annotations

import struct
from array import array
from pathlib import Path

import numpy as np

from ...core.compiled import kernel
from ...core.errors import CaptureError
from ...core.text_files import opened_file
from .colmap_files import TextLines, check_whole_text

_POINT = struct.Struct("<Q3d3BdQ")
"""points3D.bin: identity, position, colour, error and length of the track, which follows."""
_POINT_BYTES = _POINT.size
_POSITION, _COLOUR, _LENGTH = 8, 32, 43  # bytes from the start of a point
_TRACK_ELEMENT_BYTES = 8
_COUNT_BYTES = 8


def read_colmap_points(model: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """The points (P, 3) float64 and their colours (P, 3) uint8; None if the model has none.

    Points that are not finite are left out. Raises CaptureError when their file is damaged.
    """
    for name, parse in (("points3D.bin", _parse_binary), ("points3D.txt", _parse_text)):
        path = model / name
        if path.is_file():
            try:
                xyz, colours = parse(path)
            except (OSError, ValueError, IndexError) as error:
                raise CaptureError(
                    "the points of the COLMAP model cannot be read",
                    where=path,
                    cure="Export or copy the model again, or remove the file: points are then triangulated.",
                ) from error
            kept = np.isfinite(xyz).all(axis=1)
            return (xyz[kept], colours[kept]) if kept.any() else None
    return None


def _parse_binary(path: Path) -> tuple[np.ndarray, np.ndarray]:
    with opened_file(path) as stream:
        data = np.fromfile(stream, np.uint8)
    if len(data) < _COUNT_BYTES:
        raise ValueError("cut short")
    count = int(data[:_COUNT_BYTES].view("<u8")[0])
    if count * _POINT.size > len(data):
        raise ValueError("cut short")
    places = np.empty(count, np.int64)
    if not _find_points(data, places):
        raise ValueError("cut short")
    return _field(data, places, _POSITION, "<f8"), _field(data, places, _COLOUR, "u1")


def _field(data: np.ndarray, places: np.ndarray, offset: int, kind: str) -> np.ndarray:
    """Three numbers of each point, (P, 3)."""
    size = 3 * np.dtype(kind).itemsize
    rows = data[places[:, None] + (offset + np.arange(size))]
    return np.ascontiguousarray(rows).view(kind).reshape(-1, 3)


@kernel
def _find_points(data, places):
    """Fill ``places`` with the first bytes of the points; False when the data end too early."""
    place: int | np.int64 = _COUNT_BYTES
    for point in range(len(places)):
        if place + _POINT_BYTES > len(data):
            return False
        places[point] = place
        length = np.int64(0)
        for byte in range(7, -1, -1):
            length = (length << 8) | np.int64(data[place + _LENGTH + byte])
        if length < 0 or length > len(data):
            return False
        place += _POINT_BYTES + _TRACK_ELEMENT_BYTES * length
    return place <= len(data)


def _parse_text(path: Path) -> tuple[np.ndarray, np.ndarray]:
    text, found = TextLines(path), array("d")
    for line in map(str.strip, text):
        if line and not line.startswith("#"):
            numbers = [float(word) for word in line.split(maxsplit=7)[1:7]]
            if len(numbers) < 6:
                raise ValueError(f"line {text.read} is no point")
            found.extend(numbers)
    values = np.array(found, np.float64).reshape(-1, 6)
    check_whole_text(text, len(values), "points")
    return values[:, :3], np.clip(values[:, 3:], 0, 255).astype(np.uint8)
