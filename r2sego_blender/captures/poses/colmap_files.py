"""COLMAP's files found, and looked over before COLMAP reads them.

Of a binary one a wrong count takes all memory; of a text that was cut off COLMAP reads what stands before
the cut, and says nothing.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from pathlib import Path

from ...core.errors import CaptureError

COLMAP_FILES = tuple(
    f"{name}{suffix}" for name in ("cameras", "images", "points3D", "frames", "rigs") for suffix in (".bin", ".txt")
)
"""Names of the files of a model."""

_COUNT = struct.Struct("<Q")
_LEAST_CAMERA_BYTES = 4 + 4 + 8 + 8 + 2 * 8
_IMAGE_HEAD_BYTES = 4 + 7 * 8 + 4
_MEASUREMENT_BYTES = 2 * 8 + 8
_ANNOUNCED = re.compile(r"#\s*Number of (?:cameras|images|points):\s*(\d+)")
"""COLMAP's own comment; other programs that write such files may leave it out."""


def find_models(folder: Path) -> list[Path]:
    """The folders with ``cameras`` and ``images`` files in or below ``folder``.

    One in ``folder`` itself, or in ``sparse`` there, is the only one.
    """
    own = (folder, folder / "sparse")
    places = (*own, *sorted(folder.glob("[0-9]*")), *sorted(folder.glob("sparse/[0-9]*")))
    models = [place for place in places if model_suffix(place) is not None]
    return models[:1] if models and models[0] in own else models


def model_suffix(folder: Path) -> str | None:
    """The suffix of the model's files, binary first as COLMAP reads them; None if incomplete."""
    for suffix in (".bin", ".txt"):
        if all((folder / f"{name}{suffix}").is_file() for name in ("cameras", "images")):
            return suffix
    return None


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


def check_cameras_text(path: Path) -> None:
    """Raise CaptureError when cameras.txt was cut off."""
    lines = _text(path).split("\n")
    check_whole_text(path, lines, sum(map(_holds_something, lines)), "cameras")


def check_images_text(path: Path) -> None:
    """Raise CaptureError when images.txt was cut off, or not every pose has its line of measurements.

    COLMAP takes whatever stands behind a pose for that line, so where such lines are left out it
    would read every other image.
    """
    lines = _text(path).split("\n")
    count, place = 0, 0
    while place < len(lines):
        place += 1
        if not _holds_something(lines[place - 1]):
            continue
        count += 1
        # Behind the last line break is no line of its own: COLMAP leaves out such an image.
        if place >= len(lines) - (not lines[-1]):
            raise _wrong_text(
                path,
                f"line {place} is an image without its line of measurements",
                "where the image has none, end the file with an empty line",
            )
        if not _is_measurements(lines[place]):
            raise _wrong_text(
                path,
                f"line {place + 1} is not the measurements of the image before it",
                "behind each image stands a line of X, Y, POINT3D_ID, or an empty one",
            )
        place += 1
    check_whole_text(path, lines, count, "images")


def check_whole_text(path: Path, lines: Sequence[str], count: int, what: str) -> None:
    """Raise CaptureError when ``count`` is less than the lines, which end as the file does, announce.

    Where they announce it the program was COLMAP, which also ends the last line.
    """
    announced = next((int(found[1]) for found in map(_ANNOUNCED.match, lines[:10]) if found), None)
    if announced is None:
        return
    if count < announced:
        raise _wrong_text(
            path,
            f"its comment announces {announced} {what}, and {count} are there",
            "where you took some out, correct the number in the comment",
        )
    if lines[-1]:
        raise _wrong_text(path, f"line {len(lines)} is cut off", "where it is whole, end it with a new line")


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def _holds_something(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _is_measurements(line: str) -> bool:
    """Whether ``line`` has three numbers for each measurement; the last are looked at."""
    words = line.split()
    if line.lstrip().startswith("#"):
        return True
    return len(words) % 3 == 0 and all(re.fullmatch(r"[-+.0-9eE]+|nan|-?inf", word) for word in words[-3:])


def _wrong_text(path: Path, what: str, cure: str) -> CaptureError:
    return CaptureError(what, where=path, cure=f"Export or copy the COLMAP model again; {cure}.")


def _cut_short(path: Path, size: int, count: int) -> CaptureError:
    return CaptureError(
        f"the file is damaged: its {size} bytes are not those of {count} records",
        where=path,
        cure="Export or copy the COLMAP model again.",
    )
