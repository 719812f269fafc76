"""How sharp a photograph is beside others that show the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from ..core.images import load_image_uint8, resize
from ..core.progress import Progress

T = TypeVar("T")

SIDE_PX = 640
"""Longest side at which sharpness is measured: captures are as large by default."""


_SCAN_WIDTH_PX = 512
"""Width at which the photographs of a scan are compared."""


def reduced_grey(image: np.ndarray) -> np.ndarray:
    """An RGB image (H, W, 3) uint8 in grey, (h, w) uint8, at most ``SIDE_PX`` long."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    height, width = grey.shape
    share = min(1.0, SIDE_PX / max(height, width))
    return resize(grey, max(1, round(width * share)), max(1, round(height * share)))


def sharpness(grey: np.ndarray) -> float:
    """The variance of the Laplacian of a grey image (H, W) uint8: blur lowers it, as does an empty wall.

    Only images that show the same can be compared by it.
    """
    return float(cv2.Laplacian(grey, cv2.CV_32F).var())


def sharpest(found: Sequence[T], paths: Sequence[Path], most: int, what: str, progress: Progress) -> list[T]:
    """Of more than ``most`` of a recording, whose photographs are ``paths``, the sharpest of each ``most``-th part,
    which is said."""
    if len(found) <= most:
        return list(found)
    progress.message(
        f"{most} of the {len(found)} {what} are taken, the sharpest of their neighbours (captures.max_keyframes)"
    )
    return [found[index] for index in _sharpest(paths, most, progress)]


def _sharpest(paths: Sequence[Path], count: int, progress: Progress) -> list[int]:
    """One photograph of each of ``count`` consecutive parts of a recording, by its index.

    Neighbours show the same, so that their sharpness tells blur. The ``blur_score`` that Polycam writes is not
    used: its two descriptions contradict each other.
    """
    found = []
    for path in progress.track(paths, "Finding sharp keyframes"):
        grey = cv2.cvtColor(load_image_uint8(path), cv2.COLOR_RGB2GRAY)
        grey = resize(grey, _SCAN_WIDTH_PX, max(1, grey.shape[0] * _SCAN_WIDTH_PX // grey.shape[1]))
        found.append(sharpness(grey))
    parts = np.array_split(np.arange(len(paths)), count)
    return [int(part[np.argmax(np.array(found)[part])]) for part in parts]
