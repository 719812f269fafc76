"""The flat art of the room: a kilim and framed pictures, drawn with NumPy in sRGB."""

from __future__ import annotations

import numpy as np


def _rgb(code: str) -> np.ndarray:
    return np.array([int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def _smooth_noise(rng: np.random.Generator, height: int, width: int, cell_px: int) -> np.ndarray:
    """(H, W) bilinear value noise in [0, 1] with cells of ``cell_px``."""
    grid = rng.random((height // cell_px + 2, width // cell_px + 2))
    y = np.arange(height)[:, None] / cell_px
    x = np.arange(width)[None, :] / cell_px
    row, column = y.astype(int), x.astype(int)
    fy, fx = y - row, x - column
    top = grid[row, column] * (1 - fx) + grid[row, column + 1] * fx
    low = grid[row + 1, column] * (1 - fx) + grid[row + 1, column + 1] * fx
    return top * (1 - fy) + low * fy


def _texture(rng: np.random.Generator, image: np.ndarray, strength: float) -> np.ndarray:
    """The image with canvas grain and uneven pigment."""
    height, width, _ = image.shape
    grain = _smooth_noise(rng, height, width, 3) + _smooth_noise(rng, height, width, 24) - 1.0
    return np.clip(image * (1 + strength * grain[..., None]), 0.0, 1.0)


def kilim(rng: np.random.Generator, width: int = 1200, height: int = 880) -> np.ndarray:
    """A flat-woven rug: bands of diamonds, zigzags and combs, mirrored about its middle."""
    cream, rust, navy, ochre, sage, brown = map(
        _rgb, ("#e6d8bb", "#a5482c", "#26384f", "#cf9a3c", "#7f8f73", "#5a3b28")
    )
    u = np.abs(np.arange(width)[None, :] / width * 2 - 1) * np.ones((height, 1))
    v = np.arange(height)[:, None] / height * np.ones((1, width))
    image = np.empty((height, width, 3))
    image[:] = cream
    bands = [
        ("diamonds", 0.00, 0.26, cream, rust, navy),
        ("zigzag", 0.26, 0.34, navy, ochre, cream),
        ("combs", 0.34, 0.44, rust, cream, navy),
        ("diamonds", 0.44, 0.66, sage, cream, brown),
        ("zigzag", 0.66, 0.74, rust, cream, ochre),
        ("combs", 0.74, 0.83, cream, navy, rust),
        ("zigzag", 0.83, 0.90, brown, ochre, cream),
        ("plain", 0.90, 1.01, cream, cream, cream),
    ]
    for motif, start, end, ground, figure, accent in bands:
        across = (u - start) / (end - start)
        inside = (across >= 0) & (across < 1)
        image[inside] = ground
        if motif == "plain":
            continue
        if motif == "diamonds":
            away = np.abs((v * 6) % 1 - 0.5) * 2 + np.abs(across - (0.0 if start == 0 else 0.5)) * 2
            image[inside & (away < 0.92)] = figure
            image[inside & (away < 0.62)] = accent
            image[inside & (away < 0.34)] = ground
        elif motif == "zigzag":
            wave = np.abs((v * 12) % 1 - 0.5) * 2
            image[inside & (np.abs(across - 0.2 - 0.6 * wave) < 0.22)] = figure
            image[inside & (np.abs(across - 0.2 - 0.6 * wave) < 0.07)] = accent
        else:
            teeth = (v * 30) % 1 < 0.5
            image[inside & (np.abs(across - 0.5) < 0.34) & teeth] = figure
            image[inside & (np.abs(across - 0.5) < 0.09)] = accent
        image[inside & ((across > 0.96) | ((across < 0.04) & (start > 0)))] = brown
    image[(v < 0.035) | (v > 0.965)] = brown
    image[((v > 0.012) & (v < 0.026)) | ((v > 0.974) & (v < 0.988))] = ochre
    yarn = 0.93 + 0.07 * np.sin(np.arange(height) * 2 * np.pi / 4)[:, None, None]
    return _texture(rng, image * yarn, 0.28)


def hills(rng: np.random.Generator, width: int = 420, height: int = 560) -> np.ndarray:
    """Layered hills under a low sun."""
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    image = _rgb("#f2dfc2") * (1 - y[..., None]) + _rgb("#e6b98a") * y[..., None]
    image[(x - 0.62) ** 2 + ((y - 0.3) * height / width) ** 2 < 0.15**2] = _rgb("#c8502f")
    layers = ["#d9a679", "#b97a54", "#8c6a55", "#5d6b62", "#34505a", "#1f3340"]
    for depth, code in enumerate(layers):
        phase = rng.uniform(0, 6.28, 3)
        crest = 0.42 + 0.09 * depth
        crest = (
            crest
            + 0.05 * np.sin(4 * x + phase[0])
            + 0.03 * np.sin(9 * x + phase[1])
            + 0.012 * np.sin(23 * x + phase[2])
        )
        shade = 1 + 0.25 * (y - crest)
        image = np.where((y > crest)[..., None], _rgb(code) * shade[..., None], image)
    return _texture(rng, image, 0.2)


def arches(rng: np.random.Generator, width: int = 420, height: int = 560) -> np.ndarray:
    """Nested arches and discs in earth colours."""
    y, x = np.mgrid[0 : height / width : height * 1j, 0 : 1 : width * 1j]
    image = np.empty((height, width, 3))
    image[:] = _rgb("#efe4d0")
    codes = ["#b4532f", "#e2b04e", "#efe4d0", "#2d4a5c", "#8a9a7b"]
    for ring, code in enumerate(codes):
        radius = 0.4 - 0.075 * ring
        away = np.hypot(x - 0.46, np.minimum(y - 0.62, 0.0))
        image[(away < radius) & (y < 1.08)] = _rgb(code)
    image[(x - 0.74) ** 2 + (y - 0.24) ** 2 < 0.12**2] = _rgb("#c98a2c")
    image[(x - 0.24) ** 2 + (y - 1.2) ** 2 < 0.09**2] = _rgb("#2d4a5c")
    image[np.abs(y - 1.08 - 0.01 * np.sin(12 * x)) < 0.012] = _rgb("#3a2a20")
    return _texture(rng, image, 0.22)


def leaves(rng: np.random.Generator, width: int = 420, height: int = 560) -> np.ndarray:
    """A botanical print: one stem with paired leaves."""
    y, x = np.mgrid[0 : height / width : height * 1j, 0 : 1 : width * 1j]
    image = np.empty((height, width, 3))
    image[:] = _rgb("#f1ead9")
    stem = 0.5 + 0.05 * np.sin(3.2 * y)
    image[(np.abs(x - stem) < 0.008) & (y > 0.12) & (y < 1.24)] = _rgb("#4a5a3a")
    for pair in range(7):
        base_y = 0.25 + 0.145 * pair
        base_x = 0.5 + 0.05 * np.sin(3.2 * base_y)
        for side in (-1, 1):
            angle = np.deg2rad(-32 + rng.uniform(-7, 7))
            length = 0.34 - 0.026 * abs(pair - 3)
            along = (x - base_x) * side * np.cos(angle) + (y - base_y) * np.sin(angle)
            across = -(x - base_x) * side * np.sin(angle) + (y - base_y) * np.cos(angle)
            t = np.clip(along / length, 0, 1)
            inside = (along > 0) & (along < length) & (np.abs(across) < 0.062 * np.sin(np.pi * t**0.8))
            image[inside] = _rgb("#56703f") if (pair + side) % 3 else _rgb("#80935c")
            image[inside & (np.abs(across) < 0.004)] = _rgb("#cdd6ae")
    return _texture(rng, image, 0.14)


def colour_field(rng: np.random.Generator, width: int = 800, height: int = 540) -> np.ndarray:
    """A large abstract canvas: patches of colour with brushed edges."""
    y, x = np.mgrid[0 : 1 : height * 1j, 0 : 1 : width * 1j]
    wobble = 0.05 * (_smooth_noise(rng, height, width, 40) + _smooth_noise(rng, height, width, 9) - 1.0)
    image = np.empty((height, width, 3))
    image[:] = _rgb("#e9dcc4")
    patches = [  # left, top, right, bottom, colour
        (0.05, 0.08, 0.52, 0.55, "#c0653f"),
        (0.45, 0.30, 0.93, 0.86, "#2f4c63"),
        (0.14, 0.50, 0.60, 0.92, "#d9a441"),
        (0.62, 0.07, 0.90, 0.42, "#8c9b80"),
        (0.30, 0.22, 0.62, 0.64, "#7a2f2a"),
        (0.72, 0.55, 0.97, 0.95, "#efe9dc"),
        (0.40, 0.70, 0.72, 0.96, "#1d2a33"),
    ]
    for left, top, right, bottom, code in patches:
        shifted_x, shifted_y = x + wobble, y + wobble[::-1]
        inside = (shifted_x > left) & (shifted_x < right) & (shifted_y > top) & (shifted_y < bottom)
        brushed = 0.82 + 0.18 * _smooth_noise(rng, height, width, 14)
        image = np.where(inside[..., None], _rgb(code) * brushed[..., None], image)
    return _texture(rng, image, 0.16)
