"""Small right inputs, written by the project's own writers, and by what its tests write a bundle with."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from PIL import Image

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image

_TESTS = Path(__file__).parents[2] / "tests"
SIZE = (32, 24)
NAMES = ("a.png", "b.png", "c.png")
OBSERVATIONS = 8
"""Of the policies that are changed, as their layout has them."""


def of_tests(name: str) -> ModuleType:
    """A module of what the tests share."""
    for folder in (_TESTS, _TESTS / "fakes", _TESTS / "rooms"):
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
    return importlib.import_module(name)


def camera(number: int = 0) -> Camera:
    """One of the cameras of ``photographs``."""
    width, height = SIZE
    centre = np.array([0.3 + 0.4 * number, -1.9, 1.5])
    return Camera(width, height, 25.0, 25.0, width / 2, height / 2, look_at(centre, np.array([0.1, 0.5, 0.7])))


def pixels(number: int = 0) -> np.ndarray:
    """(H, W, 3) uint8, a gradient."""
    width, height = SIZE
    values = np.arange(width * height * 3) * (number + 3) % 251
    return values.reshape(height, width, 3).astype(np.uint8)


def photographs(folder: Path) -> None:
    """Write ``NAMES``."""
    for number, name in enumerate(NAMES):
        save_image(folder / name, pixels(number))


def save_picture(file: Path, **options: Any) -> None:
    """Write a picture of the file's suffix with Pillow."""
    import r2sego_blender.core.images  # noqa: F401  (registers HEIC)

    Image.fromarray(pixels()).save(file, **options)
