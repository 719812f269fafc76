"""``cameras.json``: this project's own file of captures and frozen views (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from ...core.errors import CaptureError
from ..lenses.distortion import COEFFICIENTS
from ..lenses.lens import Lens
from . import json_fields as fields
from .finding import find_photograph, images_by_stem, with_own_file_names
from .photographs import Photograph, require_lens_of_size, require_once_each, upright_size, with_unique_names


def read_cameras_json(path: Path, folder: Path, files_needed: bool = True) -> tuple[list[Photograph], bool]:
    """The photographs of the ``captures`` list, and whether the poses are metric.

    The frozen views in the same file are not looked at. Without ``files_needed`` the
    photographs may be missing, if the file says their size: for those who want cameras only.
    """
    data = fields.read_json(path)
    metric = data.get("metric", True)
    if not isinstance(metric, bool):
        raise CaptureError("'metric' is neither true nor false", where=path, cure="See docs/formats.md.")
    return _photographs(data, "captures", (data,), path, folder, files_needed), metric


def read_frozen(path: Path, folder: Path, files_needed: bool = True) -> list[Photograph]:
    """The photographs of the ``frozen`` list, with ``frozen_intrinsics`` where that is given.

    ``files_needed`` as in ``read_cameras_json``. Raises CaptureError for one that is listed twice: it would count so in
    every mean.
    """
    data = fields.read_json(path)
    if "frozen" not in data:
        raise CaptureError(
            "there is no 'frozen' list", where=path, cure="Give the cameras.json that lists held-out views."
        )
    lenses = data.get("frozen_intrinsics", {})
    if not isinstance(lenses, dict):
        raise CaptureError("'frozen_intrinsics' is no object", where=path, cure="See docs/formats.md.")
    photographs = _photographs(data, "frozen", (lenses, data), path, folder, files_needed)
    require_once_each(photographs)
    return photographs


def _photographs(
    data: Mapping[str, Any],
    key: str,
    shared: tuple[Mapping[str, Any], ...],
    path: Path,
    folder: Path,
    files_needed: bool,
) -> list[Photograph]:
    entries = {f"{key}[{index}]": entry for index, entry in enumerate(fields.entries(data, key, path))}
    names = [fields.text("file", path, field, entry) for field, entry in entries.items()]
    alone = with_own_file_names(names)
    photographs, images_in = [], cache(images_by_stem)
    for (field, entry), name in zip(entries.items(), names, strict=True):
        source = f"{path}, {field}"
        places = (entry, *shared)
        if files_needed or not _says_size(places):
            image_path = find_photograph(name, (folder, path.parent), source, name in alone, images_in)
        else:
            image_path = folder / name
        sizes = _size(places, image_path, path, field)
        fx = fields.number("fx", path, field, *places, positive=True)
        lens = Lens(
            *sizes,
            fx,
            fields.number("fy", path, field, *places, default=fx, positive=True),
            fields.number("cx", path, field, *places, default=sizes[0] / 2),
            fields.number("cy", path, field, *places, default=sizes[1] / 2),
            *_distortion(places, path, field),
            fields.number("border_px", path, field, *places, default=0.0),
        )
        if not _says_size(places):
            require_lens_of_size(lens, source, ("width", "height"))
        pose = fields.matrix("world_from_camera", path, field, entry)
        photographs.append(Photograph(name, image_path, lens, pose, source))
    return with_unique_names(photographs)


def _size(places: Sequence[Mapping[str, Any]], image_path: Path, path: Path, field: str) -> tuple[int, int]:
    if not _says_size(places):
        return upright_size(image_path)
    return fields.size(path, field, *places)


def _says_size(places: Sequence[Mapping[str, Any]]) -> bool:
    return any("width" in place or "height" in place for place in places)


def _distortion(places: Sequence[Mapping[str, Any]], path: Path, field: str) -> tuple[tuple[float, ...], str]:
    """The coefficients and the model of the distortion."""
    fisheye = next((place["fisheye"] for place in places if "fisheye" in place), False)
    default = "opencv_fisheye" if fisheye else "opencv"
    model = next((place["distortion_model"] for place in places if "distortion_model" in place), default)
    if not isinstance(model, str) or model not in COEFFICIENTS:
        raise CaptureError(
            f"'distortion_model' is {model!r}, not one of {', '.join(COEFFICIENTS)}",
            where=f"{path}, {field}",
            cure="See docs/formats.md.",
        )
    found = next((place["distortion"] for place in places if "distortion" in place), ())
    if not isinstance(found, list | tuple) or len(found) > COEFFICIENTS[model]:
        raise CaptureError(
            f"'distortion' is not a list of at most {COEFFICIENTS[model]} numbers",
            where=f"{path}, {field}",
            cure="Give k1, k2, p1, p2 as OpenCV has them.",
        )
    keyed = {f"distortion[{i}]": value for i, value in enumerate(found)}
    return tuple(fields.number(key, path, field, keyed) for key in keyed), model
