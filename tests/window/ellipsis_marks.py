"""Finds texts that Blender cut off: it ends them with three dots in one glyph."""

from pathlib import Path

import cv2
import numpy as np

_ALIKE = 0.88
_CONTRAST = 45
_LOW = 0.4  # dots lie in this share of a line, from below
_WIDTH_OF_SIZE = (0.55, 1.5)
_LINE_HEIGHT_OF_SIZE = (0.5, 1.6)
_DOT_OF_SIZE = 0.12
_FONT_PX = 11.0


def bar_of(picture: Path, bar: dict) -> np.ndarray:
    """(H, W) uint8: the side bar's part of a picture of the screen, without the tabs at its right."""
    image = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    top = bar["window_height"] - bar["y"] - bar["height"]
    return image[top : top + bar["height"], bar["x"] : bar["x"] + bar["width"]]


def templates(control: np.ndarray, scale: float) -> list[np.ndarray]:
    """The dots as they stand in a picture with many texts that are cut off in their middle."""
    size_px = _FONT_PX * scale
    text = np.abs(control.astype(np.int16) - cv2.medianBlur(control, 2 * int(size_px) + 1)) > _CONTRAST
    found = []
    for top, bottom in _runs(text.any(axis=1), *(share * size_px for share in _LINE_HEIGHT_OF_SIZE)):
        low = bottom - round(_LOW * (bottom - top))
        only_low = ~text[top:low].any(axis=0)
        dot = int(_DOT_OF_SIZE * size_px)  # less is the edge of a letter
        gap = round(0.35 * size_px)  # between two words, too, nothing is high: dots must be there
        for left, right in _runs(only_low, *(share * size_px for share in _WIDTH_OF_SIZE)):
            if len(_runs(text[low:bottom, left:right].any(axis=0), dot, gap)) >= 3:
                found.append(control[low - gap : bottom + 1, left:right])
    return found


def marks(image: np.ndarray, dots: list[np.ndarray]) -> list[tuple[int, int]]:
    """(x, y) of each cut off text's end in ``image``."""
    places = set()
    for template in dots:
        score = cv2.matchTemplate(image, template, cv2.TM_CCOEFF_NORMED)
        rows, columns = np.nonzero(score > _ALIKE)
        places |= {(int(x) // 12 * 12, int(y) // 8 * 8) for x, y in zip(columns, rows, strict=True)}
    return sorted(places)


def _runs(mask: np.ndarray, least: float, most: float) -> list[tuple[int, int]]:
    """(first, end) of the runs of True whose length is between ``least`` and ``most``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if least <= b - a <= most]
