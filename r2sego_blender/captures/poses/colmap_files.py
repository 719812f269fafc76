"""COLMAP's files found, and looked over before COLMAP reads them.

Of a binary one a wrong count takes all memory; of a text that was cut off COLMAP reads what stands before
the cut, and says nothing.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from ...core.errors import CaptureError
from ...core.text_files import opened_file

COLMAP_FILES = tuple(
    f"{name}{suffix}" for name in ("cameras", "images", "points3D", "frames", "rigs") for suffix in (".bin", ".txt")
)
"""Names of the files of a model."""

_COUNT = struct.Struct("<Q")
_LEAST_CAMERA_BYTES = 4 + 4 + 8 + 8 + 2 * 8
_IMAGE_HEAD_BYTES = 4 + 7 * 8 + 4
_MEASUREMENT_BYTES = 2 * 8 + 8
_NUMBERS_BEFORE_NAME = 9
"""Of an image in a text: identity, quaternion, translation and camera."""

_MOST_BYTES = 2 << 30
_MOST_RECORDS = 100_000
"""More photographs than are ever solved together."""

_LONGEST_LINE = 8 << 20
_ANNOUNCED = re.compile(r"#\s*Number of (?:cameras|images|points):\s*(\d{1,18})")
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
    data = _bytes(path)
    count = _COUNT.unpack_from(data)[0] if len(data) >= _COUNT.size else None
    if count is None or count > _MOST_RECORDS or count * _LEAST_CAMERA_BYTES > len(data) - _COUNT.size:
        raise _cut_short(path, len(data), count or 0)


def check_images(path: Path) -> None:
    """Raise CaptureError unless images.bin is made of whole records and nothing else.

    A record is an identity, a pose of seven doubles, the camera's identity, a name that ends
    in a zero byte, and counted measurements.
    """
    data = _bytes(path)
    place, count = _COUNT.size, 0
    if len(data) >= _COUNT.size:
        count = _COUNT.unpack_from(data)[0]
        if count > _MOST_RECORDS:
            raise _cut_short(path, len(data), count)
        for _ in range(count):
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
    text = TextLines(path)
    check_whole_text(text, sum(map(_holds_something, text)), "cameras")


def check_images_text(path: Path) -> dict[int, str]:
    """The images' names by identity: all that stands behind the nine numbers, of which COLMAP reads a word.

    Raises CaptureError when images.txt was cut off, or not every pose has its line of measurements.
    COLMAP takes whatever stands behind a pose for that line, so where such lines are left out it
    would read every other image.
    """
    text = TextLines(path)
    lines, count = iter(text), 0
    names: dict[int, str] = {}
    for line in lines:
        if not _holds_something(line):
            continue
        count += 1
        if count > _MOST_RECORDS:
            raise _wrong_text(path, f"it has more than {_MOST_RECORDS} images", "give a part of it")
        words = line.split(maxsplit=_NUMBERS_BEFORE_NAME)
        if len(words) > _NUMBERS_BEFORE_NAME and re.fullmatch("[0-9]{1,10}", words[0]):
            names[int(words[0])] = words[-1].rstrip()
        image, measurements = text.read, next(lines, None)
        # Behind the last line break is no line of its own: COLMAP leaves out such an image.
        if measurements is None:
            raise _wrong_text(
                path,
                f"line {image} is an image without its line of measurements",
                "where the image has none, end the file with an empty line",
            )
        if not _is_measurements(measurements):
            raise _wrong_text(
                path,
                f"line {text.read} is not the measurements of the image before it",
                "behind each image stands a line of X, Y, POINT3D_ID, or an empty one",
            )
    check_whole_text(text, count, "images")
    return names


class TextLines:
    """The lines of a model's text file, one at a time: all at once they take many times its memory.

    While and after they are iterated over ``read`` counts them, ``announced`` is the number of records
    that the file tells, None where it does not, and ``whole`` says whether the last line was ended.
    Raises CaptureError for a file that is too large, and a line that is too long.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.read = 0
        self.announced: int | None = None
        self.whole = True

    def __iter__(self) -> Iterator[str]:
        with _opened(self.path) as stream:
            text = io.TextIOWrapper(stream, encoding="utf-8", errors="replace")
            while line := text.readline(_LONGEST_LINE):
                self.read += 1
                self.whole = line.endswith("\n")
                if not self.whole and len(line) == _LONGEST_LINE:
                    raise _wrong_text(self.path, f"line {self.read} has no end", "check that it is the text of a model")
                found = _ANNOUNCED.match(line) if self.read <= 10 else None
                if found and self.announced is None:
                    self.announced = int(found[1])
                yield line.removesuffix("\n")


def check_whole_text(text: TextLines, count: int, what: str) -> None:
    """Raise CaptureError when ``count``, of a text read to its end, is less than its lines announce.

    Where they announce it the program was COLMAP, which also ends the last line.
    """
    if text.announced is None:
        return
    if count < text.announced:
        raise _wrong_text(
            text.path,
            f"its comment announces {text.announced} {what}, and {count} are there",
            "where you took some out, correct the number in the comment",
        )
    if not text.whole:
        raise _wrong_text(text.path, f"line {text.read} is cut off", "where it is whole, end it with a new line")


def _bytes(path: Path) -> bytes:
    with _opened(path) as stream:
        return stream.read()


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """A file of a model. Raises CaptureError for what is none, or too large."""
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(opened_file(path))
            size = os.fstat(stream.fileno()).st_size
            if size > _MOST_BYTES:
                raise ValueError(f"it has {size} bytes")
        except ValueError as error:
            raise CaptureError(f"this is of no COLMAP model: {error}", where=path, cure="Check the path.") from error
        yield stream


def _holds_something(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _is_measurements(line: str) -> bool:
    """Whether ``line`` has three numbers for each measurement; the last are looked at."""
    if line.lstrip().startswith("#"):
        return True
    words = line.split()
    return len(words) % 3 == 0 and all(re.fullmatch(r"[-+.0-9eE]+|nan|-?inf", word) for word in words[-3:])


def _wrong_text(path: Path, what: str, cure: str) -> CaptureError:
    return CaptureError(what, where=path, cure=f"Export or copy the COLMAP model again; {cure}.")


def _cut_short(path: Path, size: int, count: int) -> CaptureError:
    return CaptureError(
        f"the file is damaged: its {size} bytes are not those of {count} records",
        where=path,
        cure="Export or copy the COLMAP model again.",
    )
