"""Tileable grey textures from NumPy: what the materials look up instead of slow noise nodes."""

from __future__ import annotations

import numpy as np

SIZE_PX = 640


def fractal(rng: np.random.Generator, features: float = 8.0, slope: float = 1.55) -> np.ndarray:
    """(S, S) tileable clouds in [0, 1] with about ``features`` blobs a side and finer ones within.

    White noise is filtered in the Fourier domain: flat up to ``features`` cycles, then
    falling with frequency to the power of ``-slope``.
    """
    cycles = np.fft.fftfreq(SIZE_PX) * SIZE_PX
    frequency = np.hypot(cycles[:, None], cycles[None, :])
    weight = (1 + (frequency / features) ** 2) ** (-slope / 2 - 0.25)
    weight[0, 0] = 0.0
    spectrum = np.fft.fft2(rng.standard_normal((SIZE_PX, SIZE_PX))) * weight
    return _spread(np.fft.ifft2(spectrum).real)


def strokes(rng: np.random.Generator) -> np.ndarray:
    """(S, S) tileable swirls: clouds pulled along by other clouds, as a trowel leaves them."""
    clouds = fractal(rng)
    along, across = (fractal(rng, features=4.0, slope=2.6) - 0.5 for _ in range(2))
    y, x = np.mgrid[0:SIZE_PX, 0:SIZE_PX]
    pull_px = SIZE_PX / 10
    row = (y + pull_px * along).astype(int) % SIZE_PX
    column = (x + pull_px * across).astype(int) % SIZE_PX
    return clouds[row, column]


def yarns(rng: np.random.Generator, cells: int = 40) -> np.ndarray:
    """(S, S) tileable cells, bright in their middles: the knots of a coarse weave."""
    place = (np.arange(cells) + 0.5) / cells
    knots = np.stack(np.meshgrid(place, place), axis=-1) + rng.uniform(-0.33, 0.33, (cells, cells, 2)) / cells
    pixel = (np.arange(SIZE_PX) + 0.5) / SIZE_PX
    home = np.floor(pixel * cells).astype(int)
    nearest = np.full((SIZE_PX, SIZE_PX), np.inf)
    for step_y in (-1, 0, 1):
        for step_x in (-1, 0, 1):
            knot = knots[(home + step_y)[:, None] % cells, (home + step_x)[None, :] % cells]
            away_x = np.abs(pixel[None, :] - knot[..., 0])
            away_y = np.abs(pixel[:, None] - knot[..., 1])
            away = np.hypot(np.minimum(away_x, 1 - away_x), np.minimum(away_y, 1 - away_y))
            nearest = np.minimum(nearest, away)
    return 1.0 - np.clip(nearest * cells / 0.85, 0.0, 1.0)


def _spread(values: np.ndarray) -> np.ndarray:
    """Values mapped so that nearly all lie in [0, 1] around 0.5."""
    return np.clip(0.5 + (values - values.mean()) / (5.2 * values.std()), 0.0, 1.0)
