"""One exposure and white balance for all captures: a gain a channel each, of the points that they share."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..core.colours import linear_from_srgb
from ..core.images import at_pixels
from .capture import Capture
from .sparse_points import SparsePoints

Gain = tuple[float, float, float]
"""Factors of red, green and blue in linear light."""

MOST_GAIN = 8.0

_BLUR_PX = 2.0  # so that a pixel of misregistration does not read as a change of exposure
_DARKEST, _BRIGHTEST = 0.05, 0.95  # of sRGB: clipped values say nothing about exposure
_FEWEST_POINTS = 30
_ITERATIONS = 12
# Weight of "no change" against a capture's points, so that what shares little stays near the others.
_PRIOR_POINTS = 5.0
# What a gain has to be to count: captures of one exposure differ by less, as light that depends on the view does.
_CLEAR = np.log(1.06)
_CLEAR_SIGMAS = 5.0
_EXPLAINED = 0.85
"""Of the residual without gains, what gains have to leave at most."""


def exposure_gains_of(captures: Sequence[Capture], sparse: SparsePoints) -> list[Gain | None]:
    """The gain that brings each capture to the mean exposure of all; None for all where they agree already.

    ``sparse`` are the points that they triangulated. Their colours in linear light are fitted by one colour
    a point times one gain a capture and channel, robustly (Huber) and jointly, so that errors do not add up
    along a walk; the gains' geometric mean is 1 in each channel. A capture that shares few points stays as it is.
    """
    logs = _log_colours(captures, sparse)
    known = np.isfinite(logs[..., 0])
    logs, known = logs[known.sum(axis=1) >= 2], known[known.sum(axis=1) >= 2]
    counts = known.sum(axis=0)
    enough = counts >= _FEWEST_POINTS
    if enough.sum() < 2:
        return [None] * len(captures)
    fits = [_fitted(np.where(known, logs[..., channel], 0.0), known) for channel in range(3)]
    exposures = np.stack([exposure - exposure[enough].mean() for exposure, _, _ in fits], axis=1)
    before, after = np.mean([[before, after] for _, before, after in fits], axis=0)
    sigma = after / np.sqrt(np.maximum(counts, 1))
    clear = np.abs(exposures).max(axis=1) > np.maximum(_CLEAR, _CLEAR_SIGMAS * sigma)
    if after > _EXPLAINED * before or not (clear & enough).any():
        return [None] * len(captures)
    gains = np.clip(np.exp(-exposures), 1.0 / MOST_GAIN, MOST_GAIN).round(6).tolist()
    return [(gain[0], gain[1], gain[2]) if known else None for gain, known in zip(gains, enough, strict=True)]


def _log_colours(captures: Sequence[Capture], sparse: SparsePoints) -> np.ndarray:
    """(P, N, 3): logarithms of linear colours at the points that captures measured, NaN elsewhere."""
    logs = np.full((*sparse.visibility.shape, 3), np.nan)
    for index, capture in enumerate(captures):
        seen = np.flatnonzero(sparse.visibility[:, index])
        if not len(seen):
            continue
        image = cv2.GaussianBlur(capture.as_taken(), (0, 0), _BLUR_PX)
        colours = at_pixels(image, sparse.pixels[seen, index])
        usable = ((colours > _DARKEST) & (colours < _BRIGHTEST)).all(axis=1)
        logs[seen[usable], index] = np.log(linear_from_srgb(colours[usable]))
    return logs


def _fitted(logs: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, float, float]:
    """(N,) logarithms of exposures about 0, and the robust spread of ``logs`` (P, N) without and with them."""
    weights = known.astype(np.float64)
    exposure = np.zeros(logs.shape[1])
    before = after = 0.0
    for iteration in range(_ITERATIONS):
        sums = np.maximum(weights.sum(axis=1), 1e-9)
        points = (weights * (logs - exposure)).sum(axis=1) / sums
        residuals = logs - exposure - points[:, None]
        after = 1.4826 * float(np.median(np.abs(residuals[known]))) + 1e-6
        before = before if iteration else after
        huber = 1.5 * after / np.maximum(np.abs(residuals), 1.5 * after)
        weights = np.where(known, huber, 0.0)
        sums = np.maximum(weights.sum(axis=1), 1e-9)
        # The points' colours are eliminated: what is left are equations of the captures alone.
        means = (weights * logs).sum(axis=1) / sums
        matrix = np.diag(weights.sum(axis=0) + _PRIOR_POINTS) - weights.T @ (weights / sums[:, None])
        exposure = np.linalg.solve(matrix, (weights * (logs - means[:, None])).sum(axis=0))
        exposure -= exposure.mean()
    return exposure, before, after
