"""Reading fields of a JSON pose file with errors that name the file and the field."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...core import json_files
from ...core.errors import CaptureError, may_not_be_read


def read_json(path: Path, cure: str = "Export the poses again.") -> dict[str, Any]:
    """The JSON object in a file. Raises CaptureError when there is none; for JSON of another kind with ``cure``."""
    try:
        data = json_files.read_json(path)
    except FileNotFoundError as error:
        raise CaptureError("the pose file is missing", where=path, cure="Check the path.") from error
    except PermissionError as error:
        raise may_not_be_read(path, CaptureError) from error
    except OSError as error:
        raise CaptureError(
            f"the pose file cannot be read: {error.strerror}", where=path, cure="Check the path."
        ) from error
    except ValueError as error:
        raise CaptureError(
            f"this is not JSON ({error})", where=path, cure="Correct it there, or export or copy the file again."
        ) from error
    if not isinstance(data, dict):
        raise CaptureError("the file holds no JSON object", where=path, cure=cure)
    return data


def entries(data: Mapping[str, Any], key: str, path: Path) -> list[dict[str, Any]]:
    """The list of objects under ``key``."""
    found = data.get(key)
    if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
        raise CaptureError(f"'{key}' is not a list of objects", where=path, cure="See docs/formats.md.")
    return found


def number(
    key: str, path: Path, field: str, *places: Mapping[str, Any], default: float | None = None, positive: bool = False
) -> float:
    """The finite number under ``key`` in the first of ``places`` that has it."""
    value: Any = next((place[key] for place in places if key in place), default)
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not good or (positive and value <= 0):
        missing = value is None
        what = (
            f"'{key}' is missing"
            if missing
            else f"'{key}' is {value!r}, not a " + ("positive number" if positive else "number")
        )
        raise CaptureError(what, where=f"{path}, {field}", cure="See docs/formats.md.")
    return float(value)


def size(
    path: Path, field: str, *places: Mapping[str, Any], keys: tuple[str, str] = ("width", "height")
) -> tuple[int, int]:
    """(width, height) under ``keys``, whole pixels above 0."""
    found = []
    for key in keys:
        pixels = int(number(key, path, field, *places, positive=True))
        if pixels < 1:
            raise CaptureError(f"'{key}' is less than a pixel", where=f"{path}, {field}", cure="See docs/formats.md.")
        found.append(pixels)
    return found[0], found[1]


def text(key: str, path: Path, field: str, place: Mapping[str, Any]) -> str:
    """The text under ``key``."""
    value = place.get(key)
    if not isinstance(value, str) or not value.strip("./\\ "):
        raise CaptureError(f"'{key}' names no file", where=f"{path}, {field}", cure="See docs/formats.md.")
    return value


def matrix(key: str, path: Path, field: str, place: Mapping[str, Any]) -> np.ndarray:
    """The (4, 4) float64 matrix under ``key``; a 3x4 one gets its last row."""
    try:
        found = np.array(place[key], np.float64)
    except (KeyError, TypeError, ValueError):
        found = np.zeros(0)
    if found.shape == (3, 4):
        found = np.vstack([found, [0.0, 0.0, 0.0, 1.0]])
    if found.shape != (4, 4) or not np.isfinite(found).all():
        raise CaptureError(
            f"'{key}' is not a 4x4 matrix of numbers", where=f"{path}, {field}", cure="See docs/formats.md."
        )
    return found


def array(key: str, path: Path, field: str, place: Mapping[str, Any], shape: tuple[int, ...]) -> np.ndarray:
    """The float64 array of this shape under ``key``."""
    try:
        found = np.array(place[key], np.float64)
    except (KeyError, TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != shape or not np.isfinite(found).all():
        raise CaptureError(
            f"'{key}' is not {'x'.join(map(str, shape))} numbers", where=f"{path}, {field}", cure="See docs/formats.md."
        )
    return found
