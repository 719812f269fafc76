"""One exposure and white balance for all captures: a gain a channel each, of the points that they share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components

from ..core.colours import linear_from_srgb
from ..core.images import at_pixels
from .capture import Capture
from .sensors.sensor_maps import SensorMap
from .sparse_points import SparsePoints

Gain = tuple[float, float, float]
"""Factors of red, green and blue in linear light."""

MOST_GAIN = 8.0

_BLUR_PX = 2.0  # so that a pixel of misregistration does not read as a change of exposure
_DARKEST, _BRIGHTEST = 0.05, 0.95  # of sRGB: clipped values say nothing about exposure
_FEWEST_POINTS = 30
_LINKED_POINTS = 100  # that two captures have to share: fewer are often wrong together, or of one shiny thing
_ITERATIONS = 30
# Weight of "no change" against a capture's points, so that what shares little stays near the others.
_PRIOR_POINTS = 5.0
# What a gain has to be to count: captures of one exposure differ by less, as light that depends on the view does.
_CLEAR = np.log(1.06)
_CLEAR_PROJECTED = np.log(1.15)
"""Where only points say so that captures may not see: what stands before some has another colour."""
_CLEAR_SIGMAS = 5.0
_EXPLAINED = 0.85
"""Of the residual without gains, what gains have to leave at most."""
_SENSOR_POINTS = 1000
"""Of each capture's depth map, about: as many as sparse points, which lie on texture alone."""
_SAME_DEPTH = 0.05
"""Relative: a sensor's edges are about as wrong, and another surface is further off."""


def exposure_gains_of(
    captures: Sequence[Capture], sparse: SparsePoints, measured: Mapping[str, SensorMap] | None = None
) -> list[Gain | None]:
    """The gain that brings each capture to the mean exposure of all; None for all where they agree already.

    ``sparse`` are the points that they triangulated, ``measured`` what a depth sensor saw of those that it names.
    Colours in linear light are fitted by one colour a point times one gain a capture and channel, robustly (Huber)
    and jointly, so that errors do not add up along a walk; the gains' geometric mean is 1 in each channel.

    Tracks tell exposures best, but link too few captures: exposure and place differ most between the same two, where
    nothing is matched. Groups of captures that they do not link surely are brought together by the points' colours
    in all captures whose pictures they fall in; what stands before them in some is the robust fit's to leave out.
    Where every capture has a sensor, that tells what stands there, and all points count alike. A capture that
    shares few points stays as it is.
    """
    measured = measured or {}
    tracks, projected = _log_colours(captures, sparse, measured)
    matched = _fit(tracks)
    is_sensed = all(capture.name in measured for capture in captures)
    fit = _fit(projected) if is_sensed else _joined(matched, tracks, projected)
    if not (_are_clear(matched, _CLEAR) or _are_clear(fit, _CLEAR_PROJECTED)):
        return [None] * len(captures)
    gains = np.clip(np.exp(-fit.exposures), 1.0 / MOST_GAIN, MOST_GAIN).round(6).tolist()
    return [(gain[0], gain[1], gain[2]) if known else None for gain, known in zip(gains, fit.is_known, strict=True)]


class _Fit(NamedTuple):
    """Logarithms of ``exposures`` (N, 3), their mean over what is known 0; ``counts`` (N,) of points; and the
    residuals' robust spread without and with them."""

    exposures: np.ndarray
    counts: np.ndarray
    before: float
    after: float

    @property
    def is_known(self) -> np.ndarray:
        """(N,) bool: which captures have points enough."""
        return self.counts >= _FEWEST_POINTS


def _fit(logs: np.ndarray) -> _Fit:
    """The exposures of logarithms of colours (P, N, 3), NaN where a capture does not show the point."""
    known = np.isfinite(logs[..., 0])
    shared = known.sum(axis=1) >= 2
    logs, known = logs[shared], known[shared]
    counts = known.sum(axis=0)
    enough = counts >= _FEWEST_POINTS
    if enough.sum() < 2:
        return _Fit(np.zeros((len(counts), 3)), np.zeros_like(counts), 0.0, 0.0)
    fits = [_fitted(np.where(known, logs[..., channel], 0.0), known) for channel in range(3)]
    exposures = np.stack([exposure - exposure[enough].mean() for exposure, _, _ in fits], axis=1)
    before, after = np.mean([[before, after] for _, before, after in fits], axis=0)
    return _Fit(exposures, counts, float(before), float(after))


def _joined(matched: _Fit, tracks: np.ndarray, projected: np.ndarray) -> _Fit:
    """What ``matched`` tells within groups of captures that many ``tracks`` link, and between them the points'
    colours ``projected``, each group's as one capture's."""
    usable = np.isfinite(tracks[..., 0]).astype(np.int64)
    _, group = connected_components(usable.T @ usable >= _LINKED_POINTS)
    within = np.where(matched.is_known[:, None], matched.exposures, 0.0)
    even = projected - within
    logs = np.full((len(projected), group.max() + 1, 3), np.nan)
    for index in range(logs.shape[1]):
        members = even[:, group == index]
        count = np.isfinite(members[..., 0]).sum(axis=1)
        logs[count > 0, index] = np.nansum(members, axis=1)[count > 0] / count[count > 0, None]
    between = _fit(logs)
    exposures = within + np.where(between.is_known[:, None], between.exposures, 0.0)[group]
    counts = np.maximum(matched.counts, between.counts[group])
    known = counts >= _FEWEST_POINTS
    if known.any():
        exposures -= exposures[known].mean(axis=0)
    return _Fit(exposures, counts, between.before, between.after)


def _are_clear(fit: _Fit, least: float) -> bool:
    """Whether exposures differ: by at least ``least`` somewhere, surely, and so that they explain the colours."""
    sigma = fit.after / np.sqrt(np.maximum(fit.counts, 1))
    clear = np.abs(fit.exposures).max(axis=1) > np.maximum(least, _CLEAR_SIGMAS * sigma)
    return 0.0 < fit.after <= _EXPLAINED * fit.before and bool((clear & fit.is_known).any())


def _log_colours(
    captures: Sequence[Capture], sparse: SparsePoints, measured: Mapping[str, SensorMap]
) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of linear colours, NaN elsewhere: (P, N, 3) where captures measured the sparse points, and
    (P + Q, N, 3) in all captures that they, and then points of the sensor's, fall in."""
    maps = [measured.get(capture.name) for capture in captures]
    points = np.concatenate([sparse.points, *(_sampled(one) for one in maps if one is not None)])
    tracks = np.full((*sparse.visibility.shape, 3), np.nan)
    projected = np.full((len(points), len(captures), 3), np.nan)
    for index, (capture, sensed) in enumerate(zip(captures, maps, strict=True)):
        image = cv2.GaussianBlur(capture.as_taken(), (0, 0), _BLUR_PX)
        pixels, depth = capture.camera.project(points)
        falls_in = capture.camera.sees(pixels, depth)
        if sensed is not None:
            falls_in[falls_in] = _not_elsewhere(points[falls_in], sensed)
        seen = sparse.visibility[:, index]
        projected[falls_in, index] = _log_colours_at(image, pixels[falls_in].astype(np.float32))
        tracks[seen, index] = _log_colours_at(image, sparse.pixels[seen, index])
        projected[: len(seen)][seen, index] = tracks[seen, index]
    return tracks, projected


def _log_colours_at(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(n, 3), NaN where the colour is clipped."""
    logs = np.full((len(pixels), 3), np.nan)
    if len(pixels):
        colours = at_pixels(image, pixels)
        usable = ((colours > _DARKEST) & (colours < _BRIGHTEST)).all(axis=1)
        logs[usable] = np.log(linear_from_srgb(colours[usable]))
    return logs


def _sampled(sensed: SensorMap) -> np.ndarray:
    """(Q, 3) points of a sensor's map, evenly over it."""
    stride = max(1, round(np.sqrt(sensed.depth.size / _SENSOR_POINTS)))
    grid = (slice(stride // 2, None, stride),) * 2
    return sensed.camera.unproject(sensed.depth)[grid][sensed.depth[grid] > 0.0]


def _not_elsewhere(points: np.ndarray, sensed: SensorMap) -> np.ndarray:
    """(n,) bool: False where the sensor saw another depth than that of the point there."""
    pixels, depth = sensed.camera.project(points)
    columns, rows = np.clip(pixels.astype(np.int64), 0, [sensed.camera.width - 1, sensed.camera.height - 1]).T
    shown = sensed.depth[rows, columns]
    return (shown <= 0.0) | (np.abs(shown - depth) < _SAME_DEPTH * depth)


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
