"""The frames of a video, decoded by OpenCV's FFmpeg in child processes: a damaged file ends only those.

Only what begins as the containers that phones and cameras write is opened: a playlist that calls itself a
video would lead FFmpeg, which goes by what a file holds, to other files or into a network.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ...core.errors import CaptureError
from ...core.images import save_image
from ...core.resources import limit_memory
from ...core.text_files import opened_file
from ..sharpness import reduced_grey, sharpness
from .video_colours import VideoColours

DAMAGED_CURE = "Save it as MP4 (H.264 or HEVC), or give a folder of photographs."

_MOST_FILE_BYTES = 64 << 30
_MAGIC = re.compile(rb"....(ftyp|moov|mdat|wide|free|skip|pnot)|\x1a\x45\xdf\xa3|RIFF....AVI ", re.DOTALL)
"""How the files of QuickTime and MP4, of Matroska and WebM, and of AVI begin."""

_MOST_BYTES = 6 << 30  # of addresses: 8K in 10 bits takes 2.5 GB
_THREADS = 4  # each decodes a frame of its own
_MOST_PX = 8192 * 4352
_MOST_DECODED = 250_000
"""Frames: over an hour at 60 a second."""

_MOST_MEASURED = 6000
_TRACKING_PX = 320
_CORNERS, _FEWEST_CORNERS = 300, 20


def require_video(video: Path) -> None:
    """Raises CaptureError for a file that does not begin as a video does, or is larger than any."""
    try:
        with opened_file(video) as stream:
            begin = stream.read(12)
            size = stream.seek(0, 2)
    except (OSError, ValueError) as error:
        raise CaptureError("the video cannot be read", where=video, cure="Check the path.") from error
    if not _MAGIC.match(begin) or size > _MOST_FILE_BYTES:
        raise CaptureError("this is no video of a kind that is read", where=video, cure=DAMAGED_CURE)


def measure_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Sharpness and motion of a video's frames, at most 6000 at even distances.

    Writes ``measures``, an NPZ of ``frame`` (n,) int64, ``time_s``, ``sharpness`` and ``motion`` (n,)
    float64: the median way of corners since the frame before, as a share of the image's diagonal, NaN
    where too few were followed. The file ``told`` says meanwhile how many of a hundred parts are done.
    Returns the number of ``frames``.
    """
    limit_memory(_MOST_BYTES)
    found: list[tuple[int, float, float, float]] = []
    step, count, before = 1, 0, None
    for count, frame in enumerate(_frames(request["video"]), 1):
        if count > _MOST_DECODED:
            break
        if (count - 1) % step:
            continue
        grey = reduced_grey(frame.image())
        share = min(1.0, _TRACKING_PX / max(grey.shape))
        small = cv2.resize(grey, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        motion = np.nan if before is None else _motion(before, small)
        found.append((count - 1, frame.time_s, sharpness(grey), motion))
        before = small
        if len(found) > _MOST_MEASURED:
            ways = zip(found[1::2], found[2::2], strict=True)  # of two steps that become one
            found = [found[0], *((*after[:3], first[3] + after[3]) for first, after in ways)]
            step *= 2
        _tell(request["told"], frame.share)
    if not found:
        raise _unread(request["video"])
    columns = np.array(found).T
    np.savez(
        request["measures"],
        frame=columns[0].astype(np.int64),
        time_s=columns[1],
        sharpness=columns[2],
        motion=columns[3],
    )
    return {"frames": count}


def grey_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Write the frames numbered ``frames``, rising, as small grey images: ``grey``, an NPZ by their numbers."""
    limit_memory(_MOST_BYTES)
    np.savez(request["grey"], **{str(number): reduced_grey(frame.image()) for number, frame in _numbered(request)})
    return {}


def save_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Write the frames numbered ``frames``, rising, as PNG files of the same places in ``paths``.

    They are set upright where ``upright`` is true, else left as the sensor stored them; ``colours`` are the codes of
    ``VideoColours``. Returns the time of each in seconds, ``times_s``; it may be cut off with the video.
    """
    limit_memory(_MOST_BYTES)
    times_s = []
    colours = VideoColours(*request["colours"])
    frames = _numbered(request, request["upright"])
    for path, (_, frame) in zip(request["paths"], frames, strict=False):
        save_image(Path(path), colours.to_srgb(frame.image()))
        times_s.append(frame.time_s)
    return {"times_s": times_s}


class _Frame(NamedTuple):
    """A frame: its time in seconds, the share of the video that ends with it, and its image, once it is asked for."""

    time_s: float
    share: float
    image: Callable[[], np.ndarray]


def _numbered(request: dict[str, Any], upright: bool = True) -> Iterator[tuple[int, _Frame]]:
    """The frames numbered ``frames``, and their numbers; the file ``told`` as for ``measure_in_child``."""
    wanted, done = set(request["frames"]), 0
    for number, frame in enumerate(_frames(request["video"], upright)):
        if number in wanted:
            yield number, frame
            done += 1
            _tell(request["told"], done / len(wanted))
        if done == len(wanted):
            return


def _frames(video: str, upright: bool = True) -> Iterator[_Frame]:
    """The frames of a video in their order; their images (H, W, 3) are uint8 RGB. Raises CaptureError."""
    require_video(Path(video))
    cv2.setLogLevel(0)
    opened = cv2.VideoCapture(video, cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, _THREADS])
    try:
        width, height = (int(opened.get(which)) for which in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if not opened.isOpened() or width < 1 or height < 1:
            raise _unread(video)
        if width * height > _MOST_PX:
            raise CaptureError(
                f"the video has frames of {width}x{height} pixels", where=video, cure="Save it at 4K or smaller."
            )
        opened.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)  # its default is not the same on all systems
        turns = round(opened.get(cv2.CAP_PROP_ORIENTATION_META) / 90.0) % 4 if upright else 0
        claimed = max(opened.get(cv2.CAP_PROP_FRAME_COUNT), 1.0)

        def image() -> np.ndarray:
            whole, pixels = opened.retrieve()
            if not whole:
                raise _unread(video)
            return np.ascontiguousarray(np.rot90(pixels[..., ::-1], -turns))

        number = 0
        while opened.grab():
            number += 1
            yield _Frame(opened.get(cv2.CAP_PROP_POS_MSEC) / 1000.0, min(number / claimed, 1.0), image)
    except (cv2.error, MemoryError) as error:
        raise _unread(video) from error
    finally:
        opened.release()


def _tell(told: str, share: float) -> None:
    with contextlib.suppress(OSError):  # Windows lets nobody write a file that is being read
        Path(told).write_bytes(str(int(100 * share)).encode("ascii"))


def _motion(before: np.ndarray, after: np.ndarray) -> float:
    """The median way of corners from one grey image to the next, as a share of its diagonal; NaN unless followed."""
    corners = cv2.goodFeaturesToTrack(before, _CORNERS, 0.01, 6)
    if corners is None or len(corners) < _FEWEST_CORNERS:
        return float("nan")
    moved, followed, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, None)  # type: ignore[call-overload]  # whose types know no None
    kept = followed.ravel() == 1
    if kept.sum() < _FEWEST_CORNERS:
        return float("nan")
    ways = np.linalg.norm((moved - corners).reshape(-1, 2)[kept], axis=1)
    return float(np.median(ways) / np.hypot(after.shape[0], after.shape[1]))


def _unread(video: str) -> CaptureError:
    return CaptureError("the video cannot be read", where=video, cure=DAMAGED_CURE)
