"""How large an image may say it is, by what its file holds: pixels of one colour pack a thousand to a byte.

Needs the standard library alone, for Blender reads the pictures of a bundle too.
"""

from __future__ import annotations

from pathlib import Path

from .errors import CaptureError, R2SEgoError
from .text_files import opened_file

MOST_PX = 200_000_000
"""The pixels of the largest photograph there is, a phone's."""

LONGEST_SIDE_PX = 65_535
MOST_FILE_BYTES = 1 << 30

_ALWAYS_PX = 50_000_000
_MOST_PX_A_BYTE = 40
"""A photograph of more pixels has a byte for so many at least; the smoothest of a phone has one for 30."""

_PNG = b"\x89PNG\r\n\x1a\n"
_HEADER_BYTES = 24


def require_sensible_size(
    file: Path, width: int, height: int, file_bytes: int, error: type[R2SEgoError] = CaptureError
) -> None:
    """Raises ``error`` where an image of so many bytes says that it has more pixels than is sensible."""
    most = min(max(_ALWAYS_PX, _MOST_PX_A_BYTE * file_bytes), MOST_PX)
    if width * height > most or max(width, height) > LONGEST_SIDE_PX or file_bytes > MOST_FILE_BYTES:
        raise error(
            f"the image has {width}x{height} pixels in {file_bytes} bytes, more pixels than is sensible",
            where=file,
            cure="Scale it down.",
        )


def require_sensible_png(file: Path, error: type[R2SEgoError], cure: str = "Replace the file.") -> None:
    """Raises ``error`` where ``file`` is no PNG, or one of more pixels than is sensible."""
    try:
        with opened_file(file) as stream:
            begin, size = stream.read(_HEADER_BYTES), stream.seek(0, 2)
        if len(begin) < _HEADER_BYTES or not begin.startswith(_PNG):
            raise ValueError("it is no PNG")
    except (OSError, ValueError) as cause:
        raise error("this picture cannot be read", where=file, cure=cure) from cause
    width, height = (int.from_bytes(begin[place : place + 4], "big") for place in (16, 20))
    require_sensible_size(file, width, height, size, error)
