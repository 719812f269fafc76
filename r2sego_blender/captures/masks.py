"""Masks beside photographs: black pixels, as of a person who walked by, are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..core.errors import CaptureError
from ..core.images import load_image_uint8, opened_image, resize_nearest
from .capture import Capture

FOLDER = "masks"

_ASPECT_TOLERANCE = 0.01
_WHOLE = 0.999
"""A pixel of the camera's image counts where so much of it does in the photograph."""


def with_masks_beside(captures: Sequence[Capture], folder: Path) -> tuple[Capture, ...]:
    """The captures of photographs in ``folder``, each without a mask with the one in ``masks`` there.

    Masks are called as their photographs (``a/IMG_1.png`` of ``a/IMG_1.jpg``), or as COLMAP has
    it (``a/IMG_1.jpg.png``), within ``folder`` or within ``images`` in it or of that name.
    """
    roots = [(folder / "images", folder / FOLDER), (folder, folder / FOLDER)]
    if folder.name == "images":
        roots.insert(0, (folder, folder.parent / FOLDER))
    roots = [(images, masks) for images, masks in roots if masks.is_dir()]
    return tuple(
        capture if capture.mask_path is not None else replace(capture, mask_path=_beside(capture, roots))
        for capture in captures
    )


def counted_pixels(capture: Capture) -> np.ndarray:
    """(H, W) float32: 1 where the mask lets the pixels of the camera's image count, else 0.

    Raises CaptureError when the mask cannot be read or is not of the photograph's shape.
    """
    assert capture.mask_path is not None, "asked for a capture with a mask"
    with opened_image(capture.mask_path) as image:
        sides = image.size
    if not any(_of_shape(size, capture) for size in (sides, sides[::-1])):  # as EXIF may turn it
        raise _another_shape(sides, capture)
    shown = load_image_uint8(capture.mask_path).max(axis=2) > 0
    height, width = shown.shape
    if not _of_shape((width, height), capture):
        raise _another_shape((width, height), capture)
    width, height = capture.photograph_size
    if capture.lens is not None:
        shown = resize_nearest(shown.astype(np.uint8), height, width)
    return (capture.seen(shown.astype(np.float32)) > _WHOLE).astype(np.float32)


def _of_shape(size: tuple[int, int], capture: Capture) -> bool:
    width, height = capture.photograph_size
    return abs(size[0] / size[1] / (width / height) - 1.0) <= _ASPECT_TOLERANCE


def _another_shape(size: tuple[int, int], capture: Capture) -> CaptureError:
    width, height = capture.photograph_size
    return CaptureError(
        f"the mask is {size[0]}x{size[1]}, its photograph {capture.name} is of the shape {width}x{height}",
        where=capture.mask_path,
        cure="Give a mask of the photograph's size.",
    )


def _beside(capture: Capture, roots: Sequence[tuple[Path, Path]]) -> Path | None:
    for images, masks in roots:
        if capture.image_path.is_relative_to(images):
            name = capture.image_path.relative_to(images)
            for file in (masks / name.with_name(f"{name.name}.png"), masks / name.with_suffix(".png")):
                if file.is_file():
                    return file
    return None
