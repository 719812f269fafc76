"""A generated view's pictures side by side, as one of Blender's images."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.image_sizes import require_sensible_png
from ...results.panels.view_grid import coloured_provenance, depth_range_m, shaded_depth, side_by_side
from ...results.panels.view_parts import Part

_CURE = "Run the round again, or leave this part out."
_LARGEST_CELL_PX = 640


def read_levels(path: Path) -> np.ndarray:
    """(H, W, 4) float32 in [0, 1]: a picture's stored values, the first row at the top.

    Raises SceneError when Blender cannot read it, and for a PNG of more pixels than is sensible.
    """
    if path.suffix == ".png":
        require_sensible_png(path, SceneError, _CURE)
    try:
        image = bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError as error:
        raise SceneError("this picture cannot be read", where=path, cure=_CURE) from error
    try:
        image.colorspace_settings.is_data = True  # values as they are stored, 16 bits too
        width, height = image.size
        if not width * height:
            raise SceneError("this picture is empty or damaged", where=path, cure=_CURE)
        levels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(levels)
    finally:
        bpy.data.images.remove(image)
    return levels.reshape(height, width, 4)[::-1]


def shown_part(part: Part) -> tuple[str, np.ndarray]:
    """A part's words and its picture (H, W, 3) uint8. Raises SceneError when it is damaged."""
    levels = read_levels(part.file)
    if part.kind == "depth":
        near_m, far_m = depth_range_m(levels[..., 0])
        return f"{part.label}, {near_m:.2f} to {far_m:.2f} m", shaded_depth(levels[..., 0])
    if part.kind == "provenance":
        return part.label, coloured_provenance(np.rint(levels[..., 0] * 255.0).astype(np.int64))
    return part.label, np.rint(levels[..., :3] * 255.0).astype(np.uint8)


def compare_picture(name: str, parts: Sequence[Part]) -> bpy.types.Image:
    """One image of this name with all parts, made anew; its property ``parts`` has their words.

    Raises SceneError when there are none, or a picture is damaged.
    """
    if not parts:
        raise SceneError("there is no picture of this view", cure="Choose other parts, or another view.")
    pictures = [shown_part(part) for part in parts]
    height, width = max((picture.shape[:2] for _, picture in pictures), key=lambda size: size[1])
    scale = min(1.0, _LARGEST_CELL_PX / max(height, width))
    grid = side_by_side(pictures, (round(height * scale), round(width * scale)))
    image = image_of(name, grid)
    image["parts"] = [label for label, _ in pictures]
    return image


def image_of(name: str, picture: np.ndarray) -> bpy.types.Image:
    """The image of this name with these pixels (H, W, 3) uint8 sRGB; made when it is missing."""
    height, width = picture.shape[:2]
    image = bpy.data.images.get(name)
    if image is not None and tuple(image.size) != (width, height):
        image.scale(width, height)
    image = image or bpy.data.images.new(name, width, height, alpha=False)
    levels = np.ones((height, width, 4), np.float32)
    levels[..., :3] = picture[::-1] / np.float32(255.0)
    image.pixels.foreach_set(levels.ravel())
    image.update()
    image.pack()  # so that closing Blender does not ask to save it
    return image
