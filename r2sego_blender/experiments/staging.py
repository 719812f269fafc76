"""A data set's scene written as every plan reads one: the photographs that are used, and a ``cameras.json``.

Photographs are hard links where the disk has them, and copies elsewhere; the data set itself is not touched.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..captures.poses.photographs import Photograph
from ..captures.poses.transforms_json import GL_FROM_CV
from ..captures.sensors.sensor_depth import MILLIMETRE_M
from ..core.atomic_files import UNFINISHED, linked, remove, rename
from ..core.errors import CaptureError, ExperimentError
from ..core.file_names import caseless, plain_name
from ..core.images import stored_values
from ..core.json_files import read_json, write_json
from .datasets.dataset import Split
from .plan import PlannedScene

CAMERAS = "cameras.json"
"""Captures and held-out views of a scene."""

_DEPTH_POSES = "transforms.json"


def staged(split: Split, name: str, folder: Path, sensor_depth: bool = False) -> PlannedScene:
    """The scene ``name`` in its ``folder``, which is made whole or not at all; one that is there already is kept.

    With ``sensor_depth`` captures have what their sensor measured, too. Raises ExperimentError where there is none, or
    where the scene that is there has other captures or held-out views.
    """
    if sensor_depth and not split.depth:
        raise ExperimentError(
            f"the scene {name} has no sensor's depth", where="--sensor-depth", cure="Take the option away."
        )
    captures, frozen = _renamed(split.captures, "captures"), _renamed(split.frozen, "frozen")
    told = {
        "about": f"{name}: {split.protocol}",
        "metric": True,
        "captures": [_entry(one, place) for one, place in captures],
        "frozen": [_entry(one, place) for one, place in frozen],
    }
    poses = folder / (_DEPTH_POSES if sensor_depth else CAMERAS)
    scene = PlannedScene(folder, folder / CAMERAS, name=plain_name(name), poses=poses)
    if folder.is_dir():
        _require_same(folder, told, poses)
        return scene
    staging = folder.with_name(UNFINISHED + folder.name)
    remove(staging)
    try:
        for part in ("captures", "frozen"):
            (staging / part).mkdir(parents=True)
        for one, place in (*captures, *frozen):
            linked(one.path, staging / place)
        write_json(staging / CAMERAS, told)
        if sensor_depth:
            _write_depth(split, captures, staging)
        rename(staging, folder)
    finally:
        remove(staging)
    return scene


def _renamed(photographs: Sequence[Photograph], folder: str) -> list[tuple[Photograph, str]]:
    """Photographs with their places in a scene's folder; a name of two folders becomes one."""
    names = [plain_name(one.name) for one in photographs]
    if len(set(map(caseless, names))) < len(names):
        names = [f"{index:04d}_{name}" for index, name in enumerate(names)]
    return [(replace(one, name=name), f"{folder}/{name}") for one, name in zip(photographs, names, strict=True)]


def _entry(photograph: Photograph, place: str) -> dict[str, Any]:
    return {
        "file": place,
        "world_from_camera": np.asarray(photograph.world_from_camera, np.float64).tolist(),
        **photograph.lens.to_json(),
    }


def _require_same(folder: Path, told: dict[str, Any], poses: Path) -> None:
    try:
        known = read_json(folder / CAMERAS)
    except (OSError, ValueError):
        known = None
    if known != told or not poses.is_file():
        raise ExperimentError(
            "this scene was begun with other captures or held-out views",
            where=folder,
            cure="Give another folder with --out.",
        )


def _write_depth(split: Split, captures: Sequence[tuple[Photograph, str]], folder: Path) -> None:
    """The sensor's maps of captures in metres, 0 where it says nothing, and poses that name them."""
    (folder / "depth").mkdir()
    frames = []
    for original, (one, place) in zip(split.captures, captures, strict=True):
        lens = one.lens
        frame: dict[str, Any] = {
            "file_path": place,
            "transform_matrix": (np.asarray(one.world_from_camera, np.float64) @ GL_FROM_CV).tolist(),
            "w": lens.width,
            "h": lens.height,
            "fl_x": lens.fx,
            "fl_y": lens.fy,
            "cx": lens.cx,
            "cy": lens.cy,
        }
        if original.name in split.depth:
            metres = _metres(split.depth[original.name], split.range_m)
            np.save(folder / "depth" / f"{Path(one.name).stem}.npy", metres)
            frame["depth_file_path"] = f"depth/{Path(one.name).stem}.npy"
        frames.append(frame)
    write_json(folder / _DEPTH_POSES, {"metric": True, "frames": frames})


def _metres(file: Path, range_m: float) -> np.ndarray:
    values = stored_values(file)
    if values is None or values.dtype != np.uint16 or values.ndim != 2:
        raise CaptureError("this is no map of whole millimetres", where=file, cure="Copy it again.")
    metres = values.astype(np.float32) * np.float32(MILLIMETRE_M)
    return np.where(metres > range_m, np.float32(0.0), metres)
