"""The lenses that solving starts from: what EXIF tells of each photograph, else a usual one."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from pathlib import Path
from typing import Any

from PIL import Image

from ...core.images import DAMAGED
from ...core.scratch import ScratchFolder
from ..colmap import load_pycolmap

FOCAL_GUESS = 0.85
"""Focal length, in longest sides, of a photograph without EXIF: a phone's main camera and most compact
cameras lie between 0.7 and 1; refined by the bundle adjustment."""


def starting_cameras(
    paths: Sequence[str], sizes: Sequence[Sequence[int]], focal_guess: float = FOCAL_GUESS
) -> tuple[list[Any], list[int]]:
    """One pycolmap camera for photographs of the same size and EXIF focal length, and whose is whose."""
    pycolmap = load_pycolmap()
    cameras: list[Any] = []
    camera_of: list[int] = []
    known: dict[tuple[int, int, bool, float], int] = {}
    for path, (width, height) in zip(paths, sizes, strict=True):
        told = focal_of_exif(path)
        prior, relative = told is not None, told or focal_guess
        key = (width, height, prior, round(relative, 4))
        if key not in known:
            known[key] = len(cameras)
            focal_px = relative * max(width, height)
            camera = pycolmap.Camera(
                model="SIMPLE_RADIAL", width=width, height=height, params=[focal_px, width / 2, height / 2, 0.0]
            )
            camera.has_prior_focal_length = prior
            cameras.append(camera)
        camera_of.append(known[key])
    return cameras, camera_of


def cameras_of_their_own(cameras: Sequence[Any], camera_of: Sequence[int]) -> tuple[list[Any], list[int]]:
    """The cameras of ``starting_cameras``, one for each photograph."""
    return [copy(cameras[index]) for index in camera_of], list(range(len(camera_of)))


def solved_cameras(
    cameras: Sequence[Any], camera_of: Sequence[int], solved: Sequence[dict[str, Any]]
) -> tuple[list[Any], list[int]]:
    """The cameras of ``starting_cameras`` with the lenses of a model's images, as ``mapping`` gives them.

    A photograph that is not in the model has the lens of one that started from the same camera, if there is any.
    """
    lens_of = {image["index"]: image["camera"] for image in solved}
    first_of: dict[int, dict[str, Any]] = {}
    for index, lens in sorted(lens_of.items()):
        first_of.setdefault(camera_of[index], lens)
    found: list[Any] = []
    of_photograph: list[int] = []
    known: dict[tuple[float, ...], int] = {}
    for index, start in enumerate(camera_of):
        camera = copy(cameras[start])
        lens = lens_of.get(index, first_of.get(start))
        if lens is not None:
            focal, _, cx, cy = lens["focal"]
            camera.params = [focal, cx, cy, *lens["extra"]]
            camera.has_prior_focal_length = True
        key = (start, *camera.params)
        if key not in known:
            known[key] = len(found)
            found.append(camera)
        of_photograph.append(known[key])
    return found, of_photograph


def focal_of_exif(path: str) -> float | None:
    """The focal length, in longest sides, that a photograph's EXIF tells COLMAP; None without."""
    pycolmap = load_pycolmap()
    try:
        guess = pycolmap.infer_camera_from_image(path)
    except (RuntimeError, ValueError):  # a format that COLMAP does not read, or its path cannot be told
        try:
            with Image.open(path) as image, ScratchFolder() as folder:
                stand_in = Path(folder, "exif.jpg")
                Image.new("L", image.size).save(stand_in, exif=image.getexif())
                guess = pycolmap.infer_camera_from_image(stand_in)
        except DAMAGED:  # damaged EXIF of a sound image
            return None
    if not guess.has_prior_focal_length:
        return None
    return guess.mean_focal_length() / max(guess.width, guess.height)
