"""Render a walk through the demo living room as a phone would film it.

    python demo/make_walk.py build/walk/walk.mp4 [--seconds S] [--fps N] [--samples N] [--percentage P]

Held upright, so that the video's header turns it; with motion blur, a rolling shutter, the sway of steps,
quick turns of the head, and an exposure and white balance that follow what is seen. Frames lie beside the
video, and those that are there are not rendered again. The video is not shipped: its frames take hours.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

sys.path.insert(0, str(Path(__file__).resolve().parent))

from living_room import cameras
from make_room import BLENDER_FROM_OPENCV, build_room, set_up_render
from phone_video import write_phone_video

SHUTTER_S = 1.0 / 40.0
READOUT_S = 1.0 / 60.0
"""From the first row of the sensor to the last."""

STOPS = (  # x, y, height, heading from +x, degrees below the horizon
    (-2.02, -0.62, 1.54, 22.0, 14.0),
    (-1.62, -1.42, 1.57, 48.0, 16.0),
    (-0.62, -1.86, 1.55, 74.0, 13.0),
    (0.55, -1.84, 1.53, 102.0, 18.0),
    (1.56, -1.46, 1.56, 128.0, 14.0),
    (1.90, -0.98, 1.55, 152.0, 20.0),
    (1.50, -1.20, 1.50, 138.0, 32.0),
    (0.98, -1.45, 1.50, 118.0, 28.0),
    (0.30, -1.30, 1.50, 88.0, 34.0),
    (-0.40, -1.20, 1.50, 66.0, 28.0),
    (-1.20, -0.90, 1.50, 40.0, 34.0),
    (-1.60, -0.70, 1.50, 20.0, 22.0),
)
# The phone is held upright: the sensor's rows run from the right of the picture to its left.
_SENSOR_FROM_PICTURE = np.array(
    [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
TURNS = 1


def main() -> None:
    """Render the frames that are missing, and encode all."""
    options = parse_options()
    count = round(options.seconds * options.fps)
    build_room()
    set_up_render(options.samples)
    set_up_camera(count, options)
    scene = bpy.context.scene
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 2  # many frames: half the time of the shipped pictures
    folder = options.video.parent / "frames"
    folder.mkdir(parents=True, exist_ok=True)
    scene.render.image_settings.file_format = "PNG"
    files = [folder / f"{index:05d}.png" for index in range(count)]
    for index, file in enumerate(files):
        if file.is_file():
            continue
        scene.frame_set(index)
        # A phone's automatic exposure and white balance, of what stands bright in the picture now.
        share = index / max(count - 1, 1)
        scene.view_settings.exposure = 0.35 + 0.3 * np.sin(2.0 * np.pi * 1.5 * share)
        scene.view_settings.use_white_balance = True
        scene.view_settings.white_balance_temperature = 6500.0 + 500.0 * np.sin(2.0 * np.pi * share)
        scene.render.filepath = str(file.resolve())
        bpy.ops.render.render(write_still=True)
    write_phone_video(files, options.video, options.fps, TURNS)


def parse_options() -> argparse.Namespace:
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("video", type=Path)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--fps", type=int, default=12)
    parser.add_argument("--samples", type=int, default=4, help="Cycles samples a pixel")
    parser.add_argument("--percentage", type=int, default=100, help="of 640 x 480 pixels")
    return parser.parse_args()


def set_up_camera(count: int, options: argparse.Namespace) -> None:
    """The camera's way in frames from 0, and how it exposes."""
    scene = bpy.context.scene
    scene.render.resolution_percentage = options.percentage
    scene.render.use_motion_blur = True
    scene.cycles.rolling_shutter_type = "TOP"
    # Cycles' share of the shutter that one row is exposed for: the rest is the readout.
    scene.render.motion_blur_shutter = (SHUTTER_S + READOUT_S) * options.fps
    scene.cycles.rolling_shutter_duration = SHUTTER_S / (SHUTTER_S + READOUT_S)
    scene.camera.rotation_mode = "QUATERNION"
    last = None
    for index in range(-1, count + 1):
        pose = walk_pose(index / options.fps, options.seconds) @ _SENSOR_FROM_PICTURE
        scene.camera.matrix_world = Matrix((pose @ BLENDER_FROM_OPENCV).tolist())
        turn = scene.camera.rotation_quaternion
        if last is not None and last.dot(turn) < 0.0:
            turn.negate()
        last = turn.copy()
        scene.camera.keyframe_insert("location", frame=index)
        scene.camera.keyframe_insert("rotation_quaternion", frame=index)
    for curve in scene.camera.animation_data.action.fcurves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def walk_pose(time_s: float, seconds: float) -> np.ndarray:
    """(4, 4) world_from_camera of the upright picture: from stop to stop, with the sway of two steps a second."""
    stops = np.array(STOPS)
    place = np.clip(time_s / seconds, 0.0, 1.0) * (len(stops) - 1)
    first = min(int(place), len(stops) - 2)
    share = place - first
    share = share * share * (3.0 - 2.0 * share)  # slower at a stop, quicker between
    x, y, z, heading, down = (1.0 - share) * stops[first] + share * stops[first + 1]
    step = 2.0 * np.pi * 2.0 * time_s
    return cameras.upright(
        x,
        y,
        z + 0.015 * np.sin(step),
        heading + 1.2 * np.sin(0.5 * step) + 0.3 * np.sin(2.7 * step),
        down + 0.8 * np.sin(step + 1.0) + 0.3 * np.sin(3.1 * step),
    )


if __name__ == "__main__":
    main()
