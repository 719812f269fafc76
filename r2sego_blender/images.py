"""Reading and writing images: sRGB uint8 on disk, float32 (H, W, 3) in [0, 1] in memory."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageCms, ImageOps

from .errors import CaptureError

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".avif"})
DAMAGED = (OSError, RuntimeError, SyntaxError, ValueError, struct.error)
"""What Pillow raises for damaged files: each format has errors of its own."""

_LARGEST_PX = 200_000_000


def image_files(folder: Path) -> list[Path]:
    """The image files straight inside ``folder``, sorted by name.

    Hidden ones are none: a Mac leaves a ``._IMG_1.jpg`` that is no image beside each file.
    """
    found = (p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith("."))
    return sorted(p for p in found if p.is_file())


def load_image(path: Path) -> np.ndarray:
    """The image as (H, W, 3) float32 in [0, 1], turned upright by its EXIF orientation.

    Colours of another profile, such as a phone's Display P3, become sRGB. Raises CaptureError
    when the file is missing, empty, cut short or not an image.
    """
    return load_image_uint8(path).astype(np.float32) / 255.0


def load_image_uint8(path: Path) -> np.ndarray:
    """The image as (H, W, 3) uint8 sRGB; otherwise as ``load_image``."""
    try:
        with Image.open(path) as image:
            if image.width * image.height > _LARGEST_PX:
                raise CaptureError(
                    f"the image has {image.width}x{image.height} pixels, more than is sensible",
                    where=path, cure="Scale it down.",
                )  # fmt: skip
            return np.asarray(_srgb(ImageOps.exif_transpose(image)))
    except Image.DecompressionBombError as error:
        raise CaptureError(
            "the image has more pixels than is sensible", where=path, cure="Scale it down."
        ) from error
    except FileNotFoundError as error:
        raise CaptureError("the image is missing", where=path, cure="Check the path.") from error
    except DAMAGED as error:
        raise CaptureError(
            "the image cannot be read", where=path,
            cure="Replace the file, or take it out of the folder.",
        ) from error  # fmt: skip


def _srgb(image: Image.Image) -> Image.Image:
    """The image in 8 bits and the colours of sRGB."""
    if image.mode.startswith("I;16"):  # Pillow would cut grey values off at 255
        image = Image.fromarray((np.asarray(image) >> 8).astype(np.uint8))
    profile = image.info.get("icc_profile")
    image = image.convert("RGB")
    if not profile:
        return image
    try:
        given = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        if given.profile.xcolor_space.strip() != "RGB" or "sRGB" in ImageCms.getProfileDescription(given):
            return image
        return ImageCms.profileToProfile(image, given, ImageCms.createProfile("sRGB")) or image
    except (ImageCms.PyCMSError, OSError):  # a damaged profile says nothing
        return image


def to_uint8(image: np.ndarray) -> np.ndarray:
    """Float [0, 1] values as uint8, rounded and clipped."""
    return (np.clip(image, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def save_image(path: Path, image: np.ndarray) -> None:
    """Write (H, W, 3) or (H, W), float [0, 1] or uint8, as a PNG."""
    pixels = image if image.dtype == np.uint8 else to_uint8(image)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=3)
    path.write_bytes(buffer.getvalue())


def resize(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resample to (height, width): area average when shrinking, bilinear when growing."""
    if image.shape[:2] == (height, width):
        return image
    shrinks = width * height < image.shape[0] * image.shape[1]
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return cv2.resize(image, (width, height), interpolation=method)


def resize_nearest(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resample a map whose values must not be mixed, such as depth or ids, to (height, width)."""
    return cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST)
