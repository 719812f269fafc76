"""``transforms.json`` of nerfstudio and instant-ngp: OpenGL camera-to-world poses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CaptureError
from ...core.file_names import caseless
from ...core.printable import printable
from ...core.progress import SILENT, Progress
from ..lenses.distortion import COEFFICIENTS
from ..lenses.lens import Lens
from . import json_fields as fields
from .finding import find_beside, find_photographs, images_by_stem
from .photographs import Photograph, photograph_size, require_lens_of_size, with_unique_names

# OpenGL cameras look along -z with y up, OpenCV's along +z with y down.
GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
_PINHOLES = frozenset({"", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE"})
_RADIAL = frozenset({"OPENCV", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV"})
_FISHEYES = frozenset({"OPENCV_FISHEYE", "FISHEYE"})
_ARIA = "FISHEYE624"
_LISTED = 4


def read_transforms_json(
    path: Path, folder: Path, progress: Progress = SILENT, held_out: bool = False
) -> tuple[list[Photograph], bool]:
    """The photographs of a ``transforms.json``, and whether it declares its poses metric.

    Those of ``kept_frames``, to whom ``held_out`` belongs.

    Intrinsics stand in the file or in each frame: ``fl_x``, ``camera_angle_x`` (radians) or
    ``x_fov`` (degrees), and optionally ``fl_y, cx, cy, w, h, k1, k2, k3, k4, p1, p2``.
    Photographs that are missing are left out with a warning. ``mask_path`` and ``depth_file_path`` are noted;
    ``applied_transform`` and what else programs write are passed over: the frame of the poses may be any.
    """
    data = fields.read_json(path)
    frames = kept_frames(data, path, progress, held_out)
    names = [fields.text("file_path", path, field, frame) for field, frame in frames.items()]
    paths = find_photographs(names, (folder, path.parent), path, progress, guess_suffix=True)
    photographs, images_in = [], cache(images_by_stem)
    for (field, frame), name, image_path in zip(frames.items(), names, paths, strict=True):
        if image_path is None:
            continue
        source = f"{path}, {field}"
        pose = fields.matrix("transform_matrix", path, field, frame) @ GL_FROM_CV
        lens = _lens((frame, data), image_path, path, field)
        mask = frame.get("mask_path")
        mask_path = find_beside(mask, (path.parent, folder), images_in) if isinstance(mask, str) else None
        depth = frame.get("depth_file_path")
        depth_path = find_beside(depth, (path.parent, folder), images_in) if isinstance(depth, str) else None
        photographs.append(Photograph(name, image_path, lens, pose, source, mask_path, depth_path=depth_path))
    return with_unique_names(photographs), data.get("metric") is True


def kept_frames(
    data: Mapping[str, Any], path: Path, progress: Progress = SILENT, held_out: bool = False
) -> dict[str, dict[str, Any]]:
    """The frames to import by their fields, ``frames[0]``: none that is marked ``is_bad``, or held out.

    Held out are those in ``test_filenames`` and ``val_filenames`` but not in ``train_filenames``, and ScanNet++'s
    ``test_frames``; with ``held_out`` they alone are given, where there are any. What is left out is told.
    """
    frames = fields.entries(data, "frames", path)
    listed = {f"frames[{index}]": frame for index, frame in enumerate(frames)}
    if "test_frames" in data:
        apart = {f"test_frames[{i}]": frame for i, frame in enumerate(fields.entries(data, "test_frames", path))}
        apart = {field: frame for field, frame in apart.items() if frame.get("is_bad") is not True}
        if held_out and apart:
            return apart
        _tell_left_out(apart, "held out ('test_frames')", len(frames) + len(apart), progress)
    bad = {field: frame for field, frame in listed.items() if frame.get("is_bad") is True}
    _tell_left_out(bad, "marked 'is_bad'", len(frames), progress)
    listed = {field: frame for field, frame in listed.items() if field not in bad}
    tested, validated, trained = (_names(data, f"{part}_filenames", path) for part in ("test", "val", "train"))
    names = (tested | validated) - trained
    held = {field: frame for field, frame in listed.items() if _comparable(frame.get("file_path")) in names}
    if len(held) < len(names - {_comparable(frame.get("file_path")) for frame in bad.values()}):
        progress.message(
            f"{path}: some of the {len(names)} names in 'test_filenames' and 'val_filenames' are no frame's", "warning"
        )
    if held_out and held:
        return held
    if not held_out:
        _tell_left_out(held, "held out ('test_filenames', 'val_filenames')", len(frames), progress)
    return {field: frame for field, frame in listed.items() if field not in held}


def _names(data: Mapping[str, Any], key: str, path: Path) -> set[str]:
    """The names of files under ``key``, as ``_comparable`` has them."""
    names = data.get(key) or ()
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise CaptureError(f"'{key}' is no list of names", where=path, cure="See docs/formats.md.")
    return set(map(_comparable, names))


def _comparable(name: object) -> str:
    return caseless(Path(str(name).replace("\\", "/")).as_posix())


def _tell_left_out(frames: Mapping[str, Mapping[str, Any]], why: str, count: int, progress: Progress) -> None:
    if frames:
        names = [printable(str(frame.get("file_path"))) for frame in frames.values()]
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        told = ", ".join(names[:_LISTED]) + more
        progress.message(f"{len(frames)} of the {count} frames are {why} and left out: {told}")


def _lens(places: tuple[Mapping[str, Any], ...], image_path: Path, path: Path, field: str) -> Lens:
    width, height = _size(places, image_path, path, field)
    fx = _focal("x", width, places, path, field)
    fy = _focal("y", height, places, path, field)
    fx, fy = fx or fy, fy or fx
    if fx is None or fy is None:
        raise CaptureError(
            "neither 'fl_x' nor 'camera_angle_x' is given",
            where=f"{path}, {field}",
            cure="Add the focal length in pixels.",
        )
    cx = fields.number("cx", path, field, *places, default=width / 2)
    cy = fields.number("cy", path, field, *places, default=height / 2)
    distortion, model = _distortion(places, path, field)
    lens = Lens(width, height, fx, fy, cx, cy, distortion, model)
    in_pixels = any(key in place for place in places for key in ("fl_x", "fl_y"))
    if in_pixels and not any("w" in place for place in places):
        require_lens_of_size(lens, f"{path}, {field}", ("w", "h"))
    return lens


def _size(places: tuple[Mapping[str, Any], ...], image_path: Path, path: Path, field: str) -> tuple[int, int]:
    """(width, height) the intrinsics are for: as said, else of the photograph upright or as stored."""
    if any("w" in place for place in places):
        return fields.size(path, field, *places, keys=("w", "h"))
    width, height, turns = photograph_size(image_path)
    upright = (height, width) if turns % 2 else (width, height)
    if not all(any(key in place for place in places) for key in ("cx", "cy")):
        return upright
    centre = np.array([fields.number(key, path, field, *places) for key in ("cx", "cy")])
    # A principal point lies near the middle of the pixels it was solved on.
    sizes = (upright, (width, height)) if turns % 2 else (upright,)
    size = min(sizes, key=lambda size: np.abs(centre / size - 0.5).sum())
    if (centre <= 0).any() or (centre >= size).any():
        raise CaptureError(
            f"'cx', 'cy' are {centre[0]:g}, {centre[1]:g}, outside a photograph of {size[0]}x{size[1]}",
            where=f"{path}, {field}",
            cure="Add 'w' and 'h': the size that the focal lengths are for.",
        )
    return size


def _distortion(places: tuple[Mapping[str, Any], ...], path: Path, field: str) -> tuple[tuple[float, ...], str]:
    """The coefficients and the model of the distortion, as the programs that read the file mean them."""
    model = str(next((place["camera_model"] for place in places if "camera_model" in place), "")).upper()
    if model not in _PINHOLES | _RADIAL | _FISHEYES | {_ARIA}:
        raise CaptureError(
            f"the camera model {model} is not supported",
            where=f"{path}, {field}",
            cure="Undistort the photographs first (for example with COLMAP's image_undistorter).",
        )
    if model == _ARIA:
        found = next((place["distortion_params"] for place in places if "distortion_params" in place), ())
        keyed = {f"distortion_params[{i}]": value for i, value in enumerate(found or ())}
        if len(keyed) != COEFFICIENTS["rad_tan_thin_prism_fisheye"]:
            raise CaptureError(
                f"'distortion_params' has {len(keyed)} numbers, not twelve",
                where=f"{path}, {field}",
                cure="Export the camera again.",
            )
        return tuple(fields.number(key, path, field, keyed) for key in keyed), "rad_tan_thin_prism_fisheye"
    k1, k2, p1, p2, k3, k4, k5, k6 = (
        fields.number(key, path, field, *places, default=0.0)
        for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    )
    if model in _FISHEYES or any(place.get("is_fisheye") is True for place in places):
        return (k1, k2, k3, k4), "opencv_fisheye"
    # Some exporters repeat coefficients with a model that has none: the coefficients count.
    if k4 and model != "FULL_OPENCV":
        # To nerfstudio and Metashape k4 is one more radial term, to OpenCV the first of a divisor.
        return (k1, k2, p1, p2, k3, k4), "brown"
    return (k1, k2, p1, p2, k3, k4, k5, k6), "opencv"


def _focal(axis: str, side_px: int, places: tuple[Mapping[str, Any], ...], path: Path, field: str) -> float | None:
    """The focal length in pixels along an axis, or None where nothing tells it."""
    key = f"fl_{axis}"
    if any(key in place for place in places):
        return fields.number(key, path, field, *places, positive=True)
    for key, unit_rad in ((f"camera_angle_{axis}", 1.0), (f"{axis}_fov", math.pi / 180.0)):
        if any(key in place for place in places):
            angle_rad = unit_rad * fields.number(key, path, field, *places, positive=True)
            if angle_rad < math.pi:
                return side_px / 2 / math.tan(angle_rad / 2)
            raise CaptureError(
                f"'{key}' is {angle_rad / unit_rad:g}, not an angle below half a turn",
                where=f"{path}, {field}",
                cure="camera_angle is in radians, fov in degrees.",
            )
    return None
