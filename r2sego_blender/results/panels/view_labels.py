"""Words drawn into pictures without a font: small capital letters of 5 x 5 pixels. No bpy."""

from __future__ import annotations

import numpy as np

_ROWS = 5
_WIDTH = 5
_GLYPHS = {
    " ": "00000",
    "A": "ehvhh",
    "B": "uhuhu",
    "C": "fgggf",
    "D": "uhhhu",
    "E": "vgugv",
    "F": "vgugg",
    "G": "fgjhf",
    "H": "hhvhh",
    "I": "e444e",
    "J": "7111e",
    "K": "hiskh",
    "L": "ggggv",
    "M": "hrlhh",
    "N": "hpljh",
    "O": "ehhhe",
    "P": "uhugg",
    "Q": "ehlid",
    "R": "uhuih",
    "S": "fge1u",
    "T": "v4444",
    "U": "hhhhe",
    "V": "hhaa4",
    "W": "hhlra",
    "X": "ha4ah",
    "Y": "ha444",
    "Z": "v248v",
    "0": "ejlpe",
    "1": "4c44e",
    "2": "u1egv",
    "3": "u161u",
    "4": "iiv22",
    "5": "vgu1u",
    "6": "eguhe",
    "7": "v1244",
    "8": "ehehe",
    "9": "ehf1e",
    ".": "00004",
    ",": "00048",
    ":": "04040",
    "-": "00e00",
    "_": "0000v",
    "/": "1248g",
    "(": "24442",
    ")": "84448",
    "%": "h248h",
    "+": "04e40",
    "=": "0e0e0",
    "?": "e1604",
}
"""Each letter's rows from the top, a digit of base 32 each: five pixels, the first the highest bit."""


def text_mask(text: str, scale: int) -> np.ndarray:
    """(5 scale, 6 scale n) bool: the pixels of a line of n letters; unknown ones become ``?``."""
    columns = []
    for letter in text.upper():
        rows = np.array([int(digit, 32) for digit in _GLYPHS.get(letter, _GLYPHS["?"])])
        bits = (rows[:, None] >> np.arange(_WIDTH - 1, -1, -1)) & 1
        columns.append(np.pad(bits, ((0, 0), (0, 1))))
    line = np.concatenate(columns, axis=1) if columns else np.zeros((_ROWS, 0), np.int64)
    return np.kron(line, np.ones((scale, scale), np.int64)).astype(bool)


def draw_text(image: np.ndarray, text: str, left: int, top: int, scale: int, colour: int) -> None:
    """Write a line into ``image`` (H, W, 3); what does not fit is cut off."""
    place = image[max(0, top) : top + _ROWS * scale, max(0, left) :]
    mask = text_mask(text, scale)[: place.shape[0], : place.shape[1]]
    place[: mask.shape[0], : mask.shape[1]][mask] = colour
