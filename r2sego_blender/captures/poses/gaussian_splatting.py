"""``cameras.json`` of the original 3D Gaussian splatting: a list of pinhole cameras (Kerbl et al. 2023)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...core import json_files
from ...core.errors import CaptureError
from ...core.progress import SILENT, Progress
from ..lenses.lens import Lens
from . import json_fields as fields
from .finding import find_photographs
from .photographs import Photograph, with_unique_names


def read_cameras_of_model(path: Path, folder: Path, progress: Progress = SILENT) -> list[Photograph]:
    """The photographs of the list, those that the model was scored on among them: nothing tells them apart.

    ``position`` is the camera's centre, ``rotation`` turns its OpenCV axes into the world's, and the
    principal point is the middle of the undistorted photograph. ``img_name`` lacks its suffix in files of
    before 2024. Photographs that are missing are left out with a warning. Raises CaptureError.
    """
    try:
        listed: Any = json_files.read_json(path)
    except (OSError, ValueError) as error:
        raise CaptureError(f"the file cannot be read ({error})", where=path, cure="Copy it again.") from error
    cameras = fields.entries({"cameras": listed}, "cameras", path)
    names = [fields.text("img_name", path, f"[{i}]", camera) for i, camera in enumerate(cameras)]
    paths = find_photographs(names, (folder, folder / "images", path.parent), path, progress, guess_suffix=True)
    return with_unique_names(
        [
            _photograph(camera, name, found, path, f"[{index}]")
            for index, (camera, name, found) in enumerate(zip(cameras, names, paths, strict=True))
            if found is not None
        ]
    )


def _photograph(camera: dict[str, Any], name: str, found: Path, path: Path, field: str) -> Photograph:
    width, height = fields.size(path, field, camera)
    fx, fy = (fields.number(key, path, field, camera, positive=True) for key in ("fx", "fy"))
    pose = np.eye(4)
    for key, part in (("rotation", pose[:3, :3]), ("position", pose[:3, 3])):
        part[...] = fields.array(key, path, field, camera, part.shape)
    return Photograph(name, found, Lens(width, height, fx, fy, width / 2, height / 2), pose, f"{path}, {field}")
