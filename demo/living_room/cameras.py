"""The cameras: six captures on a walk, and sixteen frozen views from a robot's head.

Poses are ``world_from_camera``, OpenCV axes (x right, y down, z forward), metres, Z up.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path

import numpy as np

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 480, 381.0

ABOUT = (
    "A furnished living room made in Blender and rendered with Cycles by demo/make_room.py. Six captures "
    "at eye height on an arc; sixteen frozen robot head views (eight along a walk to the sofa, eight far "
    "from the captures), for scoring only. Poses: world_from_camera, OpenCV axes, metres, Z up."
)


@dataclass(frozen=True)
class View:
    """One picture to render: its stem and its (4, 4) world_from_camera pose."""

    name: str
    world_from_camera: np.ndarray


def captures() -> list[View]:
    """Six views at eye height, a person walking an arc from the west to the east."""
    walk = (  # x, y, height, heading from +x, pitch below the horizon
        (-2.02, -0.62, 1.54, 22.0, 14.0),
        (-1.62, -1.42, 1.57, 48.0, 14.0),
        (-0.62, -1.86, 1.55, 74.0, 13.0),
        (0.55, -1.84, 1.53, 102.0, 14.0),
        (1.56, -1.46, 1.56, 128.0, 14.0),
        (1.90, -0.98, 1.55, 152.0, 15.0),
    )
    return [View(f"capture_{i:02d}", upright(*stop)) for i, stop in enumerate(walk)]


def frozen_views() -> list[View]:
    """Sixteen views from a robot's head camera, looking 22 to 45 degrees down."""
    towards_the_sofa = (
        (1.30, -1.72, 1.26, 128.0, 22.0),
        (0.98, -1.38, 1.25, 132.0, 25.0),
        (0.62, -1.02, 1.27, 126.0, 28.0),
        (0.38, -0.62, 1.24, 112.0, 24.0),
        (0.34, -0.20, 1.26, 118.0, 30.0),
        (0.33, 0.22, 1.25, 135.0, 34.0),
        (0.26, 0.62, 1.23, 150.0, 38.0),
        (0.10, 0.84, 1.20, 170.0, 42.0),
    )
    far_from_the_captures = (
        (0.24, 1.00, 1.26, 208.0, 36.0),
        (1.62, 1.45, 1.25, 222.0, 30.0),
        (0.62, 0.72, 1.24, 196.0, 28.0),
        (0.72, 1.48, 1.27, -132.0, 33.0),
        (-1.30, -0.36, 1.25, 78.0, 40.0),
        (-0.30, -0.72, 1.22, 30.0, 32.0),
        (-1.02, 0.98, 1.26, -8.0, 45.0),
        (0.45, -0.95, 1.28, 150.0, 28.0),
    )
    stops = towards_the_sofa + far_from_the_captures
    return [View(f"frozen_{i:02d}", upright(*stop)) for i, stop in enumerate(stops)]


def upright(x: float, y: float, z: float, heading_deg: float, down_deg: float) -> np.ndarray:
    """The pose of a camera without roll."""
    heading, down = radians(heading_deg), radians(down_deg)
    forward = np.array([cos(heading) * cos(down), sin(heading) * cos(down), -sin(down)])
    right = np.array([sin(heading), -cos(heading), 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(forward, right), forward
    pose[:3, 3] = x, y, z
    return pose


def write_cameras(path: Path, capture_files: dict[str, View], frozen_files: dict[str, View]) -> None:
    """The project's cameras.json beside the pictures; keys are the files' paths in its folder."""
    document = {
        "about": ABOUT,
        "width": WIDTH_PX,
        "height": HEIGHT_PX,
        "fx": FOCAL_PX,
        "fy": FOCAL_PX,
        "cx": WIDTH_PX / 2,
        "cy": HEIGHT_PX / 2,
        "captures": [_entry(file, view) for file, view in capture_files.items()],
        "frozen": [_entry(file, view) for file, view in frozen_files.items()],
    }
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _entry(file: str, view: View) -> dict:
    return {"file": file, "world_from_camera": view.world_from_camera.round(9).tolist()}
