"""Structural conditions on disk: exact multilayer EXRs, and PNGs that every tool reads.

An EXR holds float32 channels ``ViewLayer.<pass>.<channel>``, as Blender names those of a
render layer, so Blender and Nuke open its passes by name; its header has the camera.
docs/conditions.md lists passes, files and conventions.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import OpenEXR

from ...core.arrays import require_between
from ...core.cameras import Camera
from ...core.colours import linear_from_srgb
from ...core.errors import CaptureError, GenerationError
from ...core.image_sizes import require_sensible_size
from ...core.images import to_uint8
from ...core.json_files import parse_json
from .conditions import Condition
from .point_condition import PointCondition

_LAYER = "ViewLayer"
_MOST_CHANNELS = 32
_FARTHEST_M = 1e6
_MOST_INSTANCES = 2.0**31 - 1.0
_CAMERA = "r2sego:camera"
_MILLIMETRES = 1000.0
_OPENGL = np.array([1.0, -1.0, -1.0], np.float32)  # x right, y up, z towards the camera
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 4]
_DAMAGE = (OSError, RuntimeError, KeyError, TypeError, ValueError, CaptureError)
"""What OpenEXR raises for a file that is missing, cut off or no EXR, and a header that is not ours."""


def save_conditions(
    folder: Path, conditions: Sequence[Condition], points: Sequence[PointCondition] = (), derived: bool = False
) -> None:
    """Write frame n as ``<n>.exr`` and PNGs beside it, n in three digits from 000.

    ``points``, when given, has one point condition a condition: its colours become
    ``<n>_points.png`` and its counts the EXR's pass ``Visibility``. ``derived`` adds what
    follows from the rest, for other tools: the passes ``Distance``, ``NormalCamera`` and,
    with points, ``Combined``, scene-linear.
    """
    folder.mkdir(parents=True, exist_ok=True)
    coloured: Sequence[PointCondition | None] = points or [None] * len(conditions)
    for index, (condition, point) in enumerate(zip(conditions, coloured, strict=True)):
        _save_exr(folder / f"{index:03d}.exr", condition, point, derived)
        for name, image in _encoded(condition, point).items():
            _, png = cv2.imencode(".png", image, _PNG)
            (folder / f"{index:03d}_{name}.png").write_bytes(png.tobytes())


def load_conditions(folder: Path) -> tuple[Condition, ...]:
    """What ``save_conditions`` wrote, to the bit, in the frames' order.

    Raises GenerationError when a file is missing or damaged.
    """
    files = sorted(folder.glob("[0-9][0-9][0-9].exr"))
    if not files:
        raise GenerationError("there are no conditions here", where=folder, cure="Run `r2sego refine` again.")
    if [file.stem for file in files] != [f"{index:03d}" for index in range(len(files))]:
        raise GenerationError("conditions are missing here", where=folder, cure="Run `r2sego refine` again.")
    return tuple(map(_load_exr, files))


def _save_exr(path: Path, condition: Condition, point: PointCondition | None, derived: bool) -> None:
    passes = {
        "Depth.V": condition.depth,
        "Validity.V": condition.validity,
        "Provenance.V": condition.provenance,
        "Instance.V": condition.instance,
        **_split("Normal", condition.normal, "XYZ"),
    }
    if point is not None:
        passes["Visibility.V"] = point.visibility
    if derived:
        passes |= {"Distance.V": condition.distance} | _split("NormalCamera", condition.normal_camera, "XYZ")
        if point is not None:
            passes |= _split("Combined", linear_from_srgb(point.colour), "RGB") | {"Combined.A": point.known}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        _CAMERA: json.dumps(condition.camera.to_json()),
    }
    channels = {f"{_LAYER}.{name}": np.ascontiguousarray(values, np.float32) for name, values in passes.items()}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def _load_exr(path: Path) -> Condition:
    try:
        camera = _camera_of(path)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
        passes = {
            name: channels[f"{_LAYER}.{name}"]
            for name in ("Depth.V", "Normal.X", "Normal.Y", "Normal.Z", "Provenance.V", "Validity.V", "Instance.V")
        }
        if any(values.shape != camera.shape or values.dtype != np.float32 for values in passes.values()):
            raise ValueError("a pass is not of the camera's size")
        require_between(0.0, _FARTHEST_M, depth=passes["Depth.V"])
        require_between(0.0, np.iinfo(np.uint8).max, provenance=passes["Provenance.V"])
        require_between(-1.0, _MOST_INSTANCES, instance=passes["Instance.V"])
        require_between(0.0, 1.0, validity=passes["Validity.V"])
    except _DAMAGE as error:
        raise GenerationError(
            "this structural condition is damaged", where=path, cure="Run `r2sego refine` again."
        ) from error
    return Condition(
        camera,
        passes["Depth.V"],
        np.stack([passes[f"Normal.{axis}"] for axis in "XYZ"], axis=-1),
        passes["Provenance.V"].astype(np.uint8),
        passes["Validity.V"],
        passes["Instance.V"].astype(np.int32),
    )


def _camera_of(path: Path) -> Camera:
    """The camera in the header, which tells an image of its size as ``save_conditions`` writes it.

    Looked at before the pixels: other kinds of EXR have ended their process, and the size is what its
    memory is taken for.
    """
    with OpenEXR.File(str(path), header_only=True) as file:
        header, parts = dict(file.header()), len(file.parts)  # leaving empties its own
    camera = Camera.from_json(parse_json(str(header[_CAMERA])))
    low, high = (corner.tolist() for corner in header["dataWindow"])
    kind = header["compression"], header["type"], parts
    if kind != (OpenEXR.ZIP_COMPRESSION, OpenEXR.scanlineimage, 1) or len(header["channels"]) > _MOST_CHANNELS:
        raise ValueError("it is an image of another kind")
    if (low, high) != ([0, 0], [camera.width - 1, camera.height - 1]):
        raise ValueError("it is not of the camera's size")
    require_sensible_size(path, camera.width, camera.height, path.stat().st_size)
    return camera


def _encoded(condition: Condition, point: PointCondition | None) -> dict[str, np.ndarray]:
    """The PNGs by name, as OpenCV takes them (blue first)."""
    millimetres = np.rint(condition.depth * _MILLIMETRES)
    millimetres[millimetres > np.iinfo(np.uint16).max] = 0  # beyond 65 m: unknown
    normal = to_uint8(0.5 + 0.5 * condition.normal_camera * _OPENGL)
    normal[condition.depth <= 0] = 0
    images = {
        "depth": millimetres.astype(np.uint16),
        "normal": np.ascontiguousarray(normal[..., ::-1]),
        "provenance": condition.provenance,
        "instance": np.minimum(condition.instance, np.iinfo(np.uint8).max).astype(np.uint8),
        "validity": to_uint8(condition.validity),
    }
    if point is not None:
        images["points"] = np.ascontiguousarray(to_uint8(point.colour)[..., ::-1])
    return images


def _split(name: str, values: np.ndarray, channels: str) -> dict[str, np.ndarray]:
    return {f"{name}.{channel}": values[..., k] for k, channel in enumerate(channels)}
