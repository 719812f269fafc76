"""The world's floor drawn into the photographs, for a person to see whether it lies right."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ...core.images import save_image, to_uint8
from ..capture import Capture

_REACH_M = 6.0
_STEP_M = 0.05
_NEAREST_M = 0.1
_GRID, _X_AXIS, _Y_AXIS, _POLE = (255, 255, 255), (255, 60, 60), (60, 220, 60), (80, 140, 255)
_SUBPIXEL_BITS = 4


def ground_picture(capture: Capture) -> np.ndarray:
    """The photograph (H, W, 3) uint8 with z = 0 drawn on it.

    White lines a metre apart; from the origin a metre of x in red, of y in green and a pole a
    metre high in blue. Nothing hides them: where they run over furniture they lie below it.
    """
    picture = np.ascontiguousarray(to_uint8(capture.image()))
    along = np.arange(-_REACH_M, _REACH_M + _STEP_M, _STEP_M)
    for at in np.arange(-_REACH_M, _REACH_M + 0.5):
        for line in (np.stack([along, np.full_like(along, at)], 1), np.stack([np.full_like(along, at), along], 1)):
            _draw(picture, capture, np.column_stack([line, np.zeros(len(line))]), _GRID, 1)
    metre = np.arange(0.0, 1.0 + _STEP_M / 2, _STEP_M)
    for axis, colour in enumerate((_X_AXIS, _Y_AXIS, _POLE)):
        _draw(picture, capture, metre[:, None] * np.eye(3)[axis], colour, 3)
    return picture


def save_ground_pictures(folder: Path, captures: Sequence[Capture]) -> None:
    """Write ``ground_picture`` of each world-frame capture, named as its image."""
    folder.mkdir(parents=True, exist_ok=True)
    for capture in captures:
        save_image(folder / f"{capture.image_path.stem}.png", ground_picture(capture))


def _draw(picture: np.ndarray, capture: Capture, line: np.ndarray, colour: tuple[int, ...], width: int) -> None:
    pixels, depth = capture.camera.project(line)
    size = np.array([capture.camera.width, capture.camera.height])
    near = (depth > _NEAREST_M) & (np.abs(pixels - size / 2) < 2 * size).all(axis=1)
    # OpenCV counts pixel centres from zero.
    places = np.rint((np.where(near[:, None], pixels, 0.0) - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int32)
    for i in np.flatnonzero(near[:-1] & near[1:]):
        cv2.line(picture, places[i], places[i + 1], colour, width, cv2.LINE_AA, _SUBPIXEL_BITS)
