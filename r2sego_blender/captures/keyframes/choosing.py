"""Choosing keyframes of a video, or of a folder that has more photographs than are asked for."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CaptureError, NativeError
from ...core.images import load_image_uint8
from ...core.progress import Progress, Task
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..poses.photographs import MIN_CAPTURES
from ..sharpness import reduced_grey, sharpness
from . import video_frames
from .thinning import likeness, sharpest_of_parts, thinned
from .video_colours import colours_of

_TIMEOUT_S = 3600.0
_PAUSE_S = 0.2
# How many pictures are compared pair by pair, for each that is kept; and how many more at most.
_COMPARED, _MOST_MORE = 3, 200


@dataclass(frozen=True)
class Keyframe:
    """One chosen frame of a video: its number from 0, its time in seconds and its file."""

    number: int
    time_s: float
    path: Path

    def __str__(self) -> str:
        minutes, seconds = divmod(round(self.time_s, 2), 60.0)
        return f"{self.number} ({int(minutes)}:{seconds:05.2f})"


def video_keyframes(
    video: Path, folder: Path, count: int, progress: Progress, frames: Sequence[str] = (), as_recorded: bool = False
) -> tuple[Keyframe, ...]:
    """Write ``count`` frames of ``video`` into ``folder`` as PNG files, upright, and say which.

    They are sharp, and together show most of the room from most places; or they are those that ``frames``
    numbers. The same video gives the same frames. ``as_recorded``: poses and depth of a recording are of them, so they
    are not turned, are called by their number alone, and need not hang together. Raises CaptureError where the video
    cannot be read, or a number is none of its frames.
    """
    video_frames.require_video(video)
    chosen = sorted(_numbers(frames))
    with ScratchFolder() as scratch:
        if not chosen:
            chosen = _chosen(video, count, Path(scratch), progress, joined=not as_recorded)
        stem = "" if as_recorded else (re.sub(r"[^A-Za-z0-9-]", "_", video.stem)[:40] or "frame") + "_"
        paths = [folder / f"{stem}{number:06d}.png" for number in chosen]
        colours = colours_of(video)
        request = {"frames": chosen, "paths": [str(path) for path in paths], "upright": not as_recorded}
        request |= {"colours": astuple(colours)}
        written = _in_child(video_frames.save_in_child, video, request, scratch, "Writing frames", progress)
    times_s = written["times_s"]
    if len(times_s) < len(chosen):
        raise CaptureError(
            f"it has no frame {chosen[len(times_s)]}", where=video, cure="Frames are numbered from 0; see --frames."
        )
    keyframes = tuple(Keyframe(*one) for one in zip(chosen, times_s, paths, strict=True))
    if colours.hdr:
        progress.message(f"{video.name} is HDR video ({colours.hdr}): its frames are tone-mapped to sRGB")
    progress.message(f"{video.name}: {len(keyframes)} frames are taken: {', '.join(map(str, keyframes))}")
    return keyframes


def photograph_keyframes(
    paths: Sequence[Path], count: int, progress: Progress, names: Sequence[str] = ()
) -> list[Path]:
    """``count`` of a folder's photographs, or those that ``names`` names, and say which; all of no more.

    Raises CaptureError for a name that is none of theirs.
    """
    if names:
        by_name = {path.name: path for path in paths}
        for name in names:
            if name not in by_name:
                raise CaptureError(
                    f"there is no photograph '{name}'", where="--frames", cure="Give names of files in the folder."
                )
        return [path for path in paths if path.name in set(names)]
    if len(paths) <= count:
        return list(paths)
    greys, sharp = [], []
    for path in progress.track(paths, "Choosing photographs"):
        grey = reduced_grey(load_image_uint8(path))
        greys.append(grey)
        sharp.append(sharpness(grey))
    candidates = sharpest_of_parts(np.ones(len(paths)), np.array(sharp), _compared(count))
    with progress.task("Comparing photographs", 1) as task:
        kept = thinned(likeness([greys[i] for i in candidates]), np.array(sharp)[candidates], count)
        task.advance()
    chosen = [paths[i] for i in candidates[kept]]
    progress.message(
        f"{len(chosen)} of the {len(paths)} photographs are taken (captures.max_keyframes): "
        f"{', '.join(path.name for path in chosen)}"
    )
    return chosen


def _chosen(video: Path, count: int, scratch: Path, progress: Progress, joined: bool) -> list[int]:
    """The numbers of the frames to take, rising: along the whole way, or as they hang together if ``joined``."""
    measures, greys_file = scratch / "measures.npz", scratch / "grey.npz"
    looked = _in_child(
        video_frames.measure_in_child, video, {"measures": str(measures)}, scratch, "Looking over the video", progress
    )
    with np.load(measures, allow_pickle=False) as data:
        frame, sharp, motion = data["frame"], data["sharpness"], data["motion"]
    if looked["frames"] < MIN_CAPTURES:
        raise CaptureError(
            f"the video has {looked['frames']} frames, at least {MIN_CAPTURES} are needed",
            where=video,
            cure="Film the room while you walk through it.",
        )
    candidates = sharpest_of_parts(motion, sharp, _compared(count) if joined else count)
    if len(candidates) <= count:
        return [int(number) for number in frame[candidates]]
    request = {"frames": frame[candidates].tolist(), "grey": str(greys_file)}
    _in_child(video_frames.grey_in_child, video, request, scratch, "Comparing frames", progress)
    with np.load(greys_file, allow_pickle=False) as data:
        alike = likeness([data[str(number)] for number in frame[candidates]])
    return [int(number) for number in frame[candidates[thinned(alike, sharp[candidates], count)]]]


def _compared(count: int) -> int:
    return min(_COMPARED * count, count + _MOST_MORE)


def _numbers(frames: Sequence[str]) -> set[int]:
    """Numbers of frames. Raises CaptureError for what is none."""
    found = set()
    for frame in frames:
        if not frame.isdecimal() or len(frame) > 9:
            raise CaptureError(
                f"'{frame}' is no number of a frame", where="--frames", cure="Of a video give numbers, from 0."
            )
        found.add(int(frame))
    if frames and len(found) < MIN_CAPTURES:
        raise CaptureError(f"{len(found)} frames are given", where="--frames", cure=f"Give {MIN_CAPTURES} at least.")
    return found


def _in_child(
    function: Callable[[dict], dict],
    video: Path,
    request: dict[str, Any],
    scratch: str | Path,
    title: str,
    progress: Progress,
) -> dict[str, Any]:
    """Call a function of ``video_frames``; what it tells in its file is shown as progress."""
    told = Path(scratch, "told")
    told.unlink(missing_ok=True)
    request = request | {"video": str(video.resolve()), "told": str(told)}
    try:
        with progress.task(title, 100) as task:
            with _following(told, task):
                result = call_in_child(function, request, timeout_s=_TIMEOUT_S)
            task.advance(100 - task.done)  # a video may have fewer frames than it says
            return result
    except NativeError as error:
        raise CaptureError(
            "the video cannot be read", where=video, cure=f"{video_frames.DAMAGED_CURE} {error}"
        ) from error


@contextmanager
def _following(told: Path, task: Task) -> Iterator[None]:
    """Within its ``with`` block the task advances to the number in the file ``told``."""
    ended = threading.Event()

    def follow() -> None:
        last = False
        while not last:
            last = ended.wait(_PAUSE_S)
            try:
                done = int(told.read_text(encoding="ascii"))
            except (OSError, ValueError):  # not begun, or just being written
                continue
            if done > task.done:
                task.advance(done - task.done)

    thread = threading.Thread(target=follow, name="frames done", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
