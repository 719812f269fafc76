"""Finds texts that Blender cut off: it ends them with three dots in one glyph."""

from pathlib import Path

import cv2
import numpy as np

_ALIKE = 0.86
_DOTS_HIGH = 0.30
_WIDE = 0.95


def bar_of(picture: Path, bar: dict) -> np.ndarray:
    """(H, W) uint8: the side bar's part of a picture of the screen, without the tabs at its right."""
    image = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    top = bar["window_height"] - bar["y"] - bar["height"]
    return image[top : top + bar["height"], bar["x"] : bar["x"] + bar["width"]]


def templates(control: np.ndarray, scale: float) -> list[np.ndarray]:
    """The dots as they end the texts of a picture in which every text is cut off."""
    size_px = 11.0 * scale
    text = np.abs(control.astype(np.int16) - int(np.median(control))) > 60
    found = []
    for top, bottom in _lines(text, int(0.5 * size_px)):
        right = np.flatnonzero(text[top:bottom].any(axis=0)).max() + 1
        width, base = round(_WIDE * size_px), bottom
        lowest = np.flatnonzero(text[top:bottom, right - width : right].any(axis=1))
        if len(lowest) and lowest.min() > 0.55 * (bottom - top):  # nothing but dots at the line's end
            high = round(_DOTS_HIGH * size_px) + 4
            found.append(control[base - high : base + 2, right - width - 1 : right + 1])
    return found


def marks(image: np.ndarray, dots: list[np.ndarray]) -> list[tuple[int, int]]:
    """(x, y) of each cut off text's end in ``image``."""
    places = set()
    for template in dots:
        score = cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED)
        rows, columns = np.nonzero(score > _ALIKE)
        places |= {(int(x) // 12 * 12, int(y) // 8 * 8) for x, y in zip(columns, rows, strict=True)}
    return sorted(places)


def _lines(text: np.ndarray, least_px: int) -> list[tuple[int, int]]:
    filled = text.any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], filled.astype(np.int8), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= least_px]
