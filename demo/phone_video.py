"""A video as a phone writes it, of frames that lie as files: HEVC or H.264, turned by what its header says.

    python demo/phone_video.py FRAMES_FOLDER VIDEO.mp4 [--fps N] [--turns N] [--codec H265|H264]

Needs pip's ``bpy``, whose FFmpeg has the encoders.
"""

from __future__ import annotations

import argparse
import struct
from pathlib import Path

BITRATE_KB = 12000  # a second, as phones take for full HD

# Of a box 'tkhd', of versions 0 and 1: where its matrix of nine 16.16 and 2.30 fixed numbers begins.
_MATRIX_AT = {0: 48, 1: 60}
_CONTAINERS = {b"moov", b"trak"}
# Clockwise quarter turns -> a, b, c, d of the matrix (ISO/IEC 14496-12, 8.3.2).
_TURNS = {0: (1, 0, 0, 1), 1: (0, 1, -1, 0), 2: (-1, 0, 0, -1), 3: (0, -1, 1, 0)}


def main() -> None:
    """Encode the pictures of a folder in the order of their names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", type=Path)
    parser.add_argument("video", type=Path)
    parser.add_argument("--fps", type=int, default=30)
    parser.add_argument("--turns", type=int, default=0, choices=range(4), help="clockwise quarter turns to upright")
    parser.add_argument("--codec", default="H265", choices=("H265", "H264"))
    options = parser.parse_args()
    write_phone_video(sorted(options.frames.iterdir()), options.video, options.fps, options.turns, options.codec)


def write_phone_video(frames: list[Path], video: Path, fps: int, turns: int = 0, codec: str = "H265") -> None:
    """Encode picture files of one size as ``video``; a player turns it by ``turns`` quarters clockwise."""
    import bpy  # what only turns a video does without

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    editor = scene.sequence_editor_create()
    strip = editor.sequences.new_image("frames", str(frames[0].resolve()), channel=1, frame_start=1)
    for frame in frames[1:]:
        strip.elements.append(frame.name)
    first = strip.elements[0]
    scene.frame_start, scene.frame_end = 1, len(frames)
    scene.render.resolution_x, scene.render.resolution_y = first.orig_width, first.orig_height
    scene.render.resolution_percentage = 100
    scene.render.fps = fps
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "FFMPEG"
    output = scene.render.ffmpeg
    output.format, output.codec, output.constant_rate_factor = "MPEG4", codec, "NONE"
    output.video_bitrate = output.maxrate = BITRATE_KB
    output.gopsize = fps
    scene.render.use_file_extension = False
    scene.render.filepath = str(video.resolve())
    bpy.ops.render.render(animation=True)
    turn(video, turns)


def turn(video: Path, turns: int) -> None:
    """Let an MP4's first track say that it stands upright after ``turns`` clockwise quarter turns. Needs no ``bpy``."""
    data = bytearray(video.read_bytes())
    at = _track_header(data, 0, len(data))
    a, b, c, d = (value << 16 for value in _TURNS[turns])
    matrix = at + _MATRIX_AT[data[at + 8]]
    struct.pack_into(">9i", data, matrix, a, b, 0, c, d, 0, 0, 0, 1 << 30)
    video.write_bytes(data)


def _track_header(data: bytearray, begin: int, end: int) -> int:
    """Where the first box 'tkhd' begins."""
    while begin < end:
        size, kind = struct.unpack_from(">I4s", data, begin)
        if kind == b"tkhd":
            return begin
        if kind in _CONTAINERS:
            return _track_header(data, begin + 8, begin + size)
        begin += size or end
    raise ValueError("the video has no track")


if __name__ == "__main__":
    main()
