"""``transforms.json`` of nerfstudio and instant-ngp: OpenGL camera-to-world poses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CaptureError
from ..progress import SILENT, Progress
from . import json_fields as fields
from .finding import find_photographs
from .lens import Lens
from .photographs import Photograph, upright_size, with_unique_names

# OpenGL cameras look along -z with y up, OpenCV's along +z with y down.
GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
_PINHOLES = frozenset({"", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE"})
_RADIAL = frozenset({"OPENCV", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV"})
_FISHEYES = frozenset({"OPENCV_FISHEYE", "FISHEYE"})


def read_transforms_json(
    path: Path, folder: Path, progress: Progress = SILENT
) -> tuple[list[Photograph], bool]:  # fmt: skip
    """The photographs of a ``transforms.json``, and whether it declares its poses metric.

    Intrinsics stand in the file or in each frame: ``fl_x``, ``camera_angle_x`` or ``x_fov``,
    and optionally ``fl_y, cx, cy, w, h, k1, k2, k3, k4, p1, p2``. Photographs that are
    missing are left out with a warning.
    """
    data = fields.read_json(path)
    frames = fields.entries(data, "frames", path)
    names = [fields.text("file_path", path, f"frames[{i}]", frame) for i, frame in enumerate(frames)]
    paths = find_photographs(names, (path.parent, folder), path, progress, guess_suffix=True)
    photographs = []
    for index, (frame, name, image_path) in enumerate(zip(frames, names, paths, strict=True)):
        if image_path is None:
            continue
        field = f"frames[{index}]"
        source = f"{path}, {field}"
        pose = fields.matrix("transform_matrix", path, field, frame) @ GL_FROM_CV
        lens = _lens((frame, data), image_path, path, field)
        photographs.append(Photograph(name, image_path, lens, pose, source))
    return with_unique_names(photographs), data.get("metric") is True


def _lens(places: tuple[Mapping[str, Any], ...], image_path: Path, path: Path, field: str) -> Lens:
    width, height = upright_size(image_path)
    if any("w" in place for place in places):
        width = int(fields.number("w", path, field, *places, positive=True))
        height = int(fields.number("h", path, field, *places, positive=True))
    fx = _focal("fl_x", "camera_angle_x", width, places, path, field)
    fy = _focal("fl_y", "camera_angle_y", height, places, path, field, default=fx)
    cx = fields.number("cx", path, field, *places, default=width / 2)
    cy = fields.number("cy", path, field, *places, default=height / 2)
    model = str(next((place["camera_model"] for place in places if "camera_model" in place), "")).upper()
    if model not in _PINHOLES | _RADIAL | _FISHEYES:
        raise CaptureError(
            f"the camera model {model} is not supported", where=f"{path}, {field}",
            cure="Undistort the photographs first (for example with COLMAP's image_undistorter).",
        )  # fmt: skip
    k = {key: fields.number(key, path, field, *places, default=0.0) for key in
         ("k1", "k2", "p1", "p2", "k3", "k4")}  # fmt: skip
    fisheye = model in _FISHEYES or any(place.get("is_fisheye") is True for place in places)
    if fisheye:
        return Lens(width, height, fx, fy, cx, cy, (k["k1"], k["k2"], k["k3"], k["k4"]), "opencv_fisheye")
    # Some exporters repeat coefficients with a model that has none: the coefficients count.
    return Lens(width, height, fx, fy, cx, cy, tuple(k.values()))


def _focal(key, angle_key, side_px, places, path, field, default=None) -> float:
    if any(key in place for place in places):
        return fields.number(key, path, field, *places, positive=True)
    if any(angle_key in place for place in places):
        angle_rad = fields.number(angle_key, path, field, *places, positive=True)
        if angle_rad < math.pi:
            return side_px / 2 / math.tan(angle_rad / 2)
        raise CaptureError(
            f"'{angle_key}' is {angle_rad}, not an angle below pi", where=f"{path}, {field}",
            cure="Give the field of view in radians.",
        )  # fmt: skip
    if default is not None:
        return default
    raise CaptureError(
        f"neither '{key}' nor '{angle_key}' is given", where=f"{path}, {field}",
        cure="Add the focal length in pixels.",
    )  # fmt: skip
