"""COLMAP's binary files looked over before COLMAP reads them, for a wrong count takes all memory."""

from __future__ import annotations

import struct
from pathlib import Path

from ..errors import CaptureError

_COUNT = struct.Struct("<Q")
_LEAST_CAMERA_BYTES = 4 + 4 + 8 + 8 + 2 * 8
_IMAGE_HEAD_BYTES = 4 + 7 * 8 + 4
_MEASUREMENT_BYTES = 2 * 8 + 8


def check_cameras(path: Path) -> None:
    """Raise CaptureError when cameras.bin is too short for the cameras it announces."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_COUNT.size)
    count = _COUNT.unpack(head)[0] if len(head) == _COUNT.size else None
    if count is None or count * _LEAST_CAMERA_BYTES > size - _COUNT.size:
        raise _cut_short(path, size, count or 0)


def check_images(path: Path) -> None:
    """Raise CaptureError unless images.bin is made of whole records and nothing else.

    A record is an identity, a pose of seven doubles, the camera's identity, a name that ends
    in a zero byte, and counted measurements.
    """
    data = path.read_bytes()
    place, count = _COUNT.size, 0
    if len(data) >= _COUNT.size:
        count = _COUNT.unpack_from(data)[0]
        for _ in range(min(count, len(data) // _IMAGE_HEAD_BYTES + 1)):
            end = data.find(b"\0", place + _IMAGE_HEAD_BYTES)
            if end < 0 or end + 1 + _COUNT.size > len(data):
                raise _cut_short(path, len(data), count)
            place = end + 1 + _COUNT.size
            place += _MEASUREMENT_BYTES * _COUNT.unpack_from(data, end + 1)[0]
            if place > len(data):
                raise _cut_short(path, len(data), count)
    if place != len(data):
        raise _cut_short(path, len(data), count)


def _cut_short(path: Path, size: int, count: int) -> CaptureError:
    return CaptureError(
        f"the file is damaged: its {size} bytes are not those of {count} records", where=path,
        cure="Export or copy the COLMAP model again.",
    )  # fmt: skip
