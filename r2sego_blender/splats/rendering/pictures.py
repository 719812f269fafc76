"""An asset seen from given cameras, as files: PNG to look at, NPZ with the exact values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...core.arrays import save_arrays
from ...core.cameras import RIGID_CURE, Camera, NotRigidError
from ...core.errors import AssetError
from ...core.images import SUFFIXES, save_image
from ...core.json_files import given_json
from ...core.progress import SILENT, Progress
from ..asset import SplatAsset
from ..formats.files import publishing
from .outputs import render_batch, render_outputs
from .rasterizer import Rendering

_LARGEST_PX = 100_000_000
_LENS = ("width", "height", "fx", "fy", "cx", "cy")
_DISTORTION = ("distortion", "fisheye", "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
"""Under which a cameras.json, or a transforms.json, tells that a lens is no pinhole."""


def camera_entries(file: Path) -> list[Any]:
    """The list ``cameras`` of a JSON file, else ``captures``, each entry with what holds for all of them.

    Raises AssetError where there is none.
    """
    data = given_json(file, AssetError, "Mend the file.", "the cameras")
    entries = (data.get("cameras") or data.get("captures")) if isinstance(data, dict) else None
    if not isinstance(entries, list) or not entries:
        raise AssetError("there is no list 'cameras'", where=file, cure="Give one entry a camera.")
    shared = {key: data[key] for key in (*_LENS, *_DISTORTION) if key in data}  # of all entries that say nothing else
    return [shared | entry if isinstance(entry, dict) else entry for entry in entries]


def cameras_of(entries: Sequence[Any], file: Path) -> dict[str, Camera]:
    """The cameras of a file's ``camera_entries`` by name.

    Each entry holds width, height, fx, fy, cx, cy in pixels and world_from_camera (4, 4), or without
    its last row, a pinhole without distortion; ``name``, else its place in the list, names the pictures.
    Raises AssetError with the entry that is wrong.
    """
    cameras: dict[str, Camera] = {}
    for index, entry in enumerate(entries):
        where = f"{file}: entry {index}"
        try:
            pose = entry["world_from_camera"]
            camera = Camera.from_json(
                {**entry, "world_from_camera": [*pose, (0.0, 0.0, 0.0, 1.0)] if len(pose) == 3 else pose}
            )
            name = str(entry.get("name", f"{index:03d}"))
        except KeyError as error:
            raise AssetError(
                f"the camera has no {error}", where=where, cure=f"Give {', '.join(_LENS)} and world_from_camera."
            ) from error
        except NotRigidError as error:
            raise AssetError(str(error), where=where, cure=RIGID_CURE) from error
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise AssetError(
                f"the camera is damaged: {error}", where=where, cure="Give all fields as numbers."
            ) from error
        size, lens = (camera.width, camera.height), (camera.fx, camera.fy, camera.cx, camera.cy)
        fits = min(size) > 0 and camera.width * camera.height <= _LARGEST_PX
        if not (fits and np.isfinite(lens).all() and min(camera.fx, camera.fy) > 0.0):
            raise AssetError("the camera has no sensible size or lens", where=where, cure="Mend it.")
        if name in cameras or not name or name.startswith(".") or set(name) & set('/\\:*?"<>|\0'):
            raise AssetError(f"'{name}' cannot name a picture of its own", where=where, cure="Rename it.")
        cameras[name] = camera
    return cameras


def photographs_of(entries: Sequence[Mapping[str, Any]], file: Path) -> list[Path]:
    """The photographs that entries of which ``cameras_of`` made cameras name as their ``file``."""
    names = [entry.get("file") for entry in entries]
    return [file.parent / name for name in names if isinstance(name, str) and "\0" not in name]


def distorted_lenses(entries: Sequence[Mapping[str, Any]]) -> int:
    """How many of these entries tell of a lens that distorts: ``cameras_of`` leaves that out."""
    told = [[entry.get(key) for key in _DISTORTION] for entry in entries]
    return sum(any(any(one) if isinstance(one, list) else one for one in values) for values in told)


def save_pictures(
    asset: SplatAsset,
    cameras: Mapping[str, Camera],
    folder: Path,
    passes: Sequence[str] = ("colour",),
    progress: Progress = SILENT,
    photographs: Collection[Path] = (),
) -> list[Path]:
    """Render ``asset`` from every camera into ``folder``, made if missing; returns the files.

    ``<name>.png`` is the colour over black, clipped and rounded to 8 bits as the evaluation
    does; of a photograph's name its suffix is left out. The other passes, alpha, depth and normals,
    have ``<name>_<pass>.png`` to look at (alpha as grey, depth from the nearest, light, to the
    farthest, dark, normals as (n + 1) / 2) and stand exactly in ``<name>.npz``: alpha (H, W), depth
    (H, W) metres, 0 where nothing is, normals (H, W, 3) in the world; all float32. Raises AssetError
    when the folder cannot be written, and before anything is where a picture would replace another, or one of the
    ``photographs``.
    """
    names, spared = _file_names(cameras), {photograph.resolve() for photograph in photographs}
    files = [folder / _file_name(name, one) for name in names for one in passes]
    for file in files:
        if file.resolve() in spared:
            raise AssetError("a picture would replace this photograph", where=file, cure="Choose another folder.")
    taken = Counter(file.name.lower() for file in files)
    if twice := [file for file in files if taken[file.name.lower()] > 1]:
        raise AssetError("two cameras' pictures would have this name", where=twice[0], cure="Rename one of them.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise AssetError(f"it cannot be made: {error.strerror}", where=folder, cure="Name another.") from error
    written = []
    renderings = _renderings(asset, cameras, "normals" in passes)
    for name, rendering in progress.track(zip(names, renderings, strict=True), "Rendering the asset", len(cameras)):
        exact = {}
        for one in passes:
            file = folder / _file_name(name, one)
            with publishing(file) as staging:
                save_image(staging, _picture(rendering, one))
            written.append(file)
            if one != "colour":
                exact[one] = getattr(rendering, one)
        if exact:
            with publishing(folder / f"{name}.npz") as staging:
                save_arrays(staging, **exact)
            written.append(folder / f"{name}.npz")
    return written


def _file_name(name: str, one: str) -> str:
    return f"{name}.png" if one == "colour" else f"{name}_{one}.png"


def _file_names(names: Collection[str]) -> list[str]:
    """The names without the suffix of an image, unless another's is then the same, or differs in case."""
    stems = [Path(name).stem if Path(name).suffix.lower() in SUFFIXES else name for name in names]
    taken = Counter(name.lower() for both in zip(names, stems, strict=True) for name in {*both})
    return [stem if taken[stem.lower()] == 1 else name for name, stem in zip(names, stems, strict=True)]


def _renderings(asset: SplatAsset, cameras: Mapping[str, Camera], normals: bool) -> Iterator[Rendering]:
    if not normals:
        return render_batch(asset, cameras.values())
    return (render_outputs(asset, camera) for camera in cameras.values())


def _picture(rendering: Rendering, name: str) -> np.ndarray:
    """A pass as an image, (H, W, 3) or (H, W) float in [0, 1]."""
    values = getattr(rendering, name)
    if name == "normals":
        return 0.5 * values + 0.5
    if name != "depth":
        return values
    seen = values > 0.0
    if not seen.any():
        return np.zeros_like(values)
    near, far = values[seen].min(), values[seen].max()
    return np.where(seen, 1.0 - 0.9 * (values - near) / max(far - near, 1e-6), 0.0)
