"""Masks of objects as Blender images of the captures' size: drawn on, painted on, handed to the engine.

An image is one mask: white where the photograph shows the object. Its custom properties name both,
and the bundle they are of.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator
from itertools import pairwise
from pathlib import Path

import bpy
import numpy as np

from ...bundle.layout import mask_stems
from ...captures.registered_views import RegisteredView
from ...core.errors import GeometryError
from ...core.image_sizes import require_sensible_png
from ...results.panels.bundle import Bundle
from ...results.panels.proxy_objects import mask_files
from ...splats.regions import in_polygon
from ..shared.moved_bundle import BUNDLE_MARK

_OBJECT, _CAPTURE, _REVISION = "r2sego_object", "r2sego_capture", "r2sego_revision"
_WHITE = 0.5
_revision_shown: dict[int, int] = {}
"""By the session's number of an image."""


def mask_images(bundle_path: str | Path, name: str) -> dict[str, bpy.types.Image]:
    """The masks of a bundle's object that Blender holds, by the captures' names."""
    return {image[_CAPTURE]: image for image in _masks(bundle_path) if image[_OBJECT] == name}


def masked_objects(bundle_path: str | Path) -> list[str]:
    """The names of the bundle's objects of which Blender holds a mask that is not empty."""
    return sorted({image[_OBJECT] for image in _masks(bundle_path) if read_mask(image).any()})


def mask_image(bundle_path: str | Path, name: str, view: RegisteredView) -> bpy.types.Image:
    """The mask of a bundle's object in a capture; an empty one is made where there is none."""
    image = mask_images(bundle_path, name).get(view.name)
    if image is not None:
        return image
    width, height = view.camera.width, view.camera.height
    image = bpy.data.images.new(f"{name} in {view.name}", width, height, alpha=False)
    image.colorspace_settings.is_data = True
    image[BUNDLE_MARK], image[_OBJECT], image[_CAPTURE] = str(bundle_path), name, view.name
    image.use_fake_user = True  # nothing in Blender uses it: it would not be saved
    write_mask(image, np.zeros((height, width), bool))
    return image


def read_mask(image: bpy.types.Image) -> np.ndarray:
    """(H, W) bool, the first row at the top."""
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    colours = pixels.reshape(height, width, image.channels)[..., : min(3, image.channels)]
    return np.ascontiguousarray(colours.max(axis=2)[::-1] >= _WHITE)


def mask_in(image: bpy.types.Image, view: RegisteredView) -> np.ndarray:
    """The mask (H, W) bool of a capture. Raises GeometryError where the image has another size."""
    mask = read_mask(image)
    if mask.shape != view.camera.shape:
        raise GeometryError(
            "the mask is not of the capture's size",
            where=image.name,
            cure=f"Resize the image to {view.camera.width} by {view.camera.height} pixels, or undo.",
        )
    return mask


def write_mask(image: bpy.types.Image, mask: np.ndarray) -> None:
    """Show a mask (H, W) bool in an image, which takes its size, and keep it in the .blend."""
    if tuple(image.size) != mask.shape[::-1]:
        image.scale(mask.shape[1], mask.shape[0])
    pixels = np.ones((*mask.shape, image.channels), np.float32)
    pixels[..., : min(3, image.channels)] = mask[::-1, :, None]
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()  # a generated image is not saved otherwise
    image[_REVISION] = _revision_shown[image.session_uid] = revision(image) + 1


def revision(image: bpy.types.Image) -> int:
    """Another number after each ``write_mask``; strokes in the Image Editor do not count."""
    return int(image.get(_REVISION, 0))


def take_pixels_back() -> None:
    """After undo or redo, which brings back what is packed in an image and leaves what it shows."""
    for image in bpy.data.images:
        if _revision_shown.get(image.session_uid, revision(image)) != revision(image):
            image.buffers_free()
            _revision_shown[image.session_uid] = revision(image)


def load_masks(bundle: Bundle, name: str, *, anew: bool = True) -> int:
    """Take the bundle's masks of an object into images; how many.

    They replace those drawn, or where not ``anew`` only join them: in captures without one.
    """
    count = 0
    for view, _, mask in list(_declared_masks(bundle, name, () if anew else mask_images(bundle.path, name))):
        write_mask(mask_image(bundle.path, name, view), mask)
        count += 1
    return count


def known_masks(bundle: Bundle, name: str) -> dict[str, np.ndarray]:
    """An object's masks (H, W) bool by the captures' names: those Blender holds, else the bundle's. Leaves
    no image in Blender: one that is made in no step of its history crashes a later undo."""
    images, views = mask_images(bundle.path, name), bundle.captures()
    held = {view.name: mask_in(images[view.name], view) for view in views if view.name in images}
    return held | {view.name: mask for view, _, mask in _declared_masks(bundle, name, held)}


def save_masks(bundle: Bundle, folder: Path, names: list[str], declared: Collection[str]) -> int:
    """Write the masks of objects as ``r2sego objects --masks`` reads them; how many are not empty.

    Of the objects that are ``declared`` those of the bundle, too, that Blender does not hold; it holds
    no more of them afterwards.
    """
    count, stems = 0, _stems(bundle)
    for name in names:
        held, place = mask_images(bundle.path, name), folder / name
        for _, file, mask in _declared_masks(bundle, name, held) if name in declared else ():
            if mask.any():
                place.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, place / file.name)
                count += 1
        for capture, image in held.items():
            if not read_mask(image).any():
                continue
            place.mkdir(parents=True, exist_ok=True)
            if image.is_dirty:  # a copy has what was packed, without strokes painted since
                image.pack()
            copy = image.copy()  # saving would tie the person's own image to the file
            try:
                copy.file_format = "PNG"
                copy.filepath_raw = str(place / f"{stems.get(capture, Path(capture).stem)}.png")
                copy.save()
            finally:
                bpy.data.images.remove(copy)
            count += 1
    return count


def forget_masks(bundle_path: str | Path, name: str) -> None:
    """Remove the images of a bundle's object."""
    for image in mask_images(bundle_path, name).values():
        bpy.data.images.remove(image)


def drawn_region(shape: tuple[int, int], points: np.ndarray, tool: str, radius_px: float) -> np.ndarray:
    """(H, W) bool: the pixels inside a polygon ``points`` (n, 2), or within a BRUSH's way, pixels."""
    height, width = shape
    points = np.asarray(points, np.float64).reshape(-1, 2)
    region = np.zeros(shape, bool)
    reach = radius_px if tool == "BRUSH" else 0.0
    low = np.floor(points.min(0) - reach).astype(int).clip(0)
    high = np.minimum(np.ceil(points.max(0) + reach).astype(int) + 1, (width, height))
    if (high <= low).any():
        return region
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    centres = np.stack([x.ravel(), y.ravel()], axis=1)
    inside = _near_line(centres, points, reach) if tool == "BRUSH" else in_polygon(centres, points)
    region[low[1] : high[1], low[0] : high[0]] = inside.reshape(x.shape)
    return region


def _masks(bundle_path: str | Path) -> list[bpy.types.Image]:
    path = str(bundle_path)
    return [image for image in bpy.data.images if _OBJECT in image and image.get(BUNDLE_MARK) == path]


def _near_line(centres: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """(N,) bool: the places within ``reach`` of a line through ``points``."""
    near = np.zeros(len(centres), bool)
    lines = list(pairwise(points)) or [(points[0], points[0])]
    for start, end in lines:
        along = end - start
        share = np.clip((centres - start) @ along / max(along @ along, 1e-12), 0.0, 1.0)
        near |= ((centres - start - share[:, None] * along) ** 2).sum(1) <= reach**2
    return near


def _declared_masks(
    bundle: Bundle, name: str, there: Collection[str]
) -> Iterator[tuple[RegisteredView, Path, np.ndarray]]:
    """The bundle's masks of an object in the captures that are not ``there``, each with its file."""
    files, stems = mask_files(bundle, name), _stems(bundle)
    for view in bundle.captures():
        file = files.get(stems[view.name])
        if file is None or view.name in there:
            continue
        mask = _mask_of_file(file)
        if mask.shape != view.camera.shape:
            raise GeometryError("the mask is not of the capture's size", where=file, cure="Declare the masks again.")
        yield view, file, mask


def _stems(bundle: Bundle) -> dict[str, str]:
    return mask_stems([view.name for view in bundle.captures()])


def _mask_of_file(file: Path) -> np.ndarray:
    require_sensible_png(file, GeometryError, "Declare the masks again.")
    image = bpy.data.images.load(str(file), check_existing=False)
    try:
        image.colorspace_settings.is_data = True
        if not image.size[0]:
            raise GeometryError("the mask cannot be read", where=file, cure="Declare the masks again.")
        return read_mask(image)
    finally:
        bpy.data.images.remove(image)
