"""Videos of the box room, as a phone writes them: blurred here and there, and turned by their header."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import to_uint8

PHONE_VIDEO = Path(__file__).resolve().parents[2] / "demo" / "phone_video.py"
LENS = Camera(240, 320, 240.0, 240.0, 120.0, 160.0, np.eye(4))
"""Held upright."""

SUBFRAMES = 5


def phone_video():
    """The program that writes videos, as a module."""
    spec = importlib.util.spec_from_file_location("phone_video", PHONE_VIDEO)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def walk(time: float) -> Camera:
    """Where the phone is at a time in [0, 1]: along an arc, always looking at the far corner."""
    place = (-1.2 + 2.6 * time, -2.4 + 0.5 * time**2, 1.5)
    return LENS.at(look_at(place, (0.1 + 0.4 * np.sin(3.0 * time), 0.6, 0.6)))


def filmed(image: Callable[[Camera], np.ndarray], count: int, shakes: Sequence[int] = ()) -> list[np.ndarray]:
    """The walk's frames, uint8 RGB, upright; those of ``shakes`` are blurred as by a jolt of the hand."""
    frames = []
    for index in range(count):
        camera = walk(index / (count - 1))
        if index in shakes:
            turned = [
                camera.at(camera.world_from_camera @ _turn(angle)) for angle in np.linspace(-0.03, 0.03, SUBFRAMES)
            ]
            frames.append(to_uint8(np.mean([image(one) for one in turned], axis=0)))
        else:
            frames.append(to_uint8(image(camera)))
    return frames


def write_video(path: Path, frames: Sequence[np.ndarray], fps: float = 10.0, turns: int = 1) -> Path:
    """MPEG-4, stored as a sensor that lies does, so that ``turns`` clockwise quarters set it upright."""
    stored = [np.ascontiguousarray(np.rot90(frame, turns)) for frame in frames]
    height, width = stored[0].shape[:2]
    kind = cv2.VideoWriter_fourcc(*("mp4v" if path.suffix in (".mp4", ".mov") else "MJPG"))
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, kind, fps, (width, height))
    assert writer.isOpened()
    for frame in stored:
        writer.write(frame[..., ::-1])
    writer.release()
    if path.suffix in (".mp4", ".mov"):
        phone_video().turn(path, turns)
    return path


def state_colours(video: Path, primaries: int, transfer: int, matrix: int) -> Path:
    """Put a ``colr`` box into an MP4 file, in which ``moov`` comes last, as OpenCV writes it."""
    colr = struct.pack(">I4s4sHHHB", 19, b"colr", b"nclx", primaries, transfer, matrix, 0)
    path = [b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd", b"mp4v"]
    video.write_bytes(_with_box(video.read_bytes(), path, colr))
    return video


def _with_box(content: bytes, path: Sequence[bytes], box: bytes) -> bytes:
    """What holds the boxes ``path``, one within the other, with another box at the end of the innermost."""
    if not path:
        return content + box
    place = 8 if content[12:16] == path[0] and path[0] == b"mp4v" else 0  # of a list its head
    while content[place + 4 : place + 8] != path[0]:
        place += struct.unpack(">I", content[place : place + 4])[0]
    size = struct.unpack(">I", content[place : place + 4])[0]
    inner = _with_box(content[place + 8 : place + size], path[1:], box)
    return content[:place] + struct.pack(">I4s", len(inner) + 8, path[0]) + inner + content[place + size :]


def _turn(angle: float) -> np.ndarray:
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(np.array([0.3 * angle, angle, 0.0]))[0]
    return turn
