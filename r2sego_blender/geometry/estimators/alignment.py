"""An estimate's scale and shift, and how far it is off: fitted robustly to depth that is known.

Models of one photograph know depth up to a scale, or a scale and a shift, of it or of its inverse. What they are
off by besides varies slowly over the picture: where known depth is near, it is told and taken away, if that proves
itself on known depth that it was not made of.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

_TO_SIGMA = 1.4826  # of a median absolute deviation
_TRIALS = 300  # pairs of pixels that a line is drawn through
_ROUNDS = 10
_MOST_REFERENCES = 6000
_LEAST_GAIN = 0.05  # of the median error by which a shift has to be better than none
_LEAST_SIGMA = 0.01  # what the known depth is off by itself
_LARGEST_OFF = 0.25  # relative; an estimate that is off by more shows something else
_CLOSE = 0.08  # off by no more, it need not tell near from far: before a wall there is nothing to tell
_EXPLAINS = 0.7  # of how far known depth lies apart, what an estimate may be off by
_MOST_SIGMA = 0.25  # what is less sure says nothing
_LARGEST_CHANGE = 20.0  # times the farthest known depth
_BLOCKS = 6  # a side, of which half tell of the other half
_FEWEST = 10  # known pixels of a half that tell anything of the other
_REACH = 0.04  # sigma of what varies slowly, of the longest side
_HALF_KNOWN = 0.05  # share of known pixels in that reach at which half of it is told
_LEAST_LOCAL_GAIN = 0.1
_JUMP = 1.08  # ratio of neighbouring depths at an edge
_EDGE_REACH = 0.012  # of the longest side
_RANGES = 4  # of distance that have residuals of their own
_AS_MANY = 50.0  # pixels' worth of belief that a range's residuals are like all


@dataclass(frozen=True)
class Alignment:
    """``scale`` and ``shift`` of depth, or of its inverse where ``inverse``, that bring an estimate to metres."""

    scale: float
    shift: float
    inverse: bool

    def of(self, depth: np.ndarray) -> np.ndarray:
        """Metres float32 for depth in the estimator's unit; 0 where that is 0 and where nothing is left in front."""
        known = depth > 0.0
        value = np.where(known, depth, 1.0).astype(np.float64)
        value = self.scale * (1.0 / value if self.inverse else value) + self.shift
        ahead = known & (value > 1e-6)
        metres = np.where(ahead, value, 1.0)
        return np.where(ahead, 1.0 / metres if self.inverse else metres, 0.0).astype(np.float32)


@dataclass(frozen=True)
class Aligned:
    """An estimate (H, W) in metres, 0 unknown, its relative ``sigma`` (H, W), and how it was brought there.

    ``off`` is the robust relative standard deviation of its residuals.
    """

    depth: np.ndarray
    sigma: np.ndarray
    by: Alignment
    off: float


def aligned(depth: np.ndarray, sigma: np.ndarray, reference: np.ndarray) -> Aligned | None:
    """``depth`` (H, W) in its own unit with the proportions of its ``sigma``, brought to ``reference`` (H, W) metres.

    Both are 0 where unknown. None where no scale brings them together, and where one depth for all would explain
    about as much.
    """
    both = (depth > 0.0) & (reference > 0.0)
    found = fitted(depth[both], reference[both])
    if found is None:
        return None
    metres = found.of(depth)
    off = _TO_SIGMA * _off(found, depth[both], reference[both])
    if off > _LARGEST_OFF or (
        off > _CLOSE and off > _EXPLAINS * _spread(np.log(reference[both] / np.median(reference[both])))
    ):
        return None
    metres[metres > _LARGEST_CHANGE * reference.max()] = 0.0
    both &= metres > 0.0
    if not both.any():
        return None
    residual = _residual(metres, reference, both)
    near_edge = beside_edges(metres)
    unit = np.where(sigma > 0.0, sigma, 1.0)
    alone, left = _of_the_other_half(depth, reference, both, residual)
    level = _levels(metres, near_edge, alone / unit, both)
    if _spread(left[both]) < (1.0 - _LEAST_LOCAL_GAIN) * _spread(alone[both]):
        slow, known_near = _slow(residual, both)
        metres = (metres * np.exp(slow)).astype(np.float32)
        near_level = _levels(metres, near_edge, left / unit, both)
        level = np.sqrt(known_near * near_level**2 + (1.0 - known_near) * level**2)
    relative = np.maximum(level * sigma, _LEAST_SIGMA) * _beyond(metres, reference[both])
    metres[relative > _MOST_SIGMA] = 0.0
    known = metres > 0.0
    return Aligned(metres, np.where(known, relative, 0.0).astype(np.float32), found, off)


def fitted(depth: np.ndarray, reference: np.ndarray) -> Alignment | None:
    """What brings ``depth`` (n,) in its own unit to ``reference`` (n,) metres, both positive.

    A shift, of depth or of its inverse, is taken where it explains more than a scale alone. None where no positive
    scale does.
    """
    every = max(1, len(depth) // _MOST_REFERENCES)
    depth, reference = (values[::every].astype(np.float64) for values in (depth, reference))
    if not len(depth):
        return None
    plain = Alignment(float(np.median(reference / depth)), 0.0, inverse=False)
    best, least = plain, (1.0 - _LEAST_GAIN) * _off(plain, depth, reference)
    for inverse in (False, True):
        value, wanted = (1.0 / depth, 1.0 / reference) if inverse else (depth, reference)
        line = _line(value, wanted)
        if line is not None:
            shifted = Alignment(*line, inverse=inverse)
            off = _off(shifted, depth, reference)
            if off < least:
                best, least = shifted, off
    return best


def _off(by: Alignment, depth: np.ndarray, reference: np.ndarray) -> float:
    """The median relative error; what is brought behind the camera is as wrong as can be."""
    metres = by.of(depth).astype(np.float64)
    return float(np.median(np.where(metres > 0.0, np.abs(np.log(np.maximum(metres, 1e-9) / reference)), np.inf)))


def _line(value: np.ndarray, wanted: np.ndarray) -> tuple[float, float] | None:
    """Scale and shift of ``value`` (n,) that give ``wanted`` (n,), least in relative error, against outliers."""
    rng = np.random.default_rng(0)
    one, other = rng.integers(len(value), size=(2, _TRIALS))
    apart = value[other] - value[one]
    sound = np.abs(apart) > 1e-3 * np.abs(value[one])
    slope = (wanted[other] - wanted[one])[sound] / apart[sound]
    start = wanted[one][sound] - slope * value[one][sound]
    ahead = slope > 0.0
    if not ahead.any():
        return None
    slope, start = slope[ahead], start[ahead]
    errors = [np.median(np.abs(a * value + b - wanted) / wanted) for a, b in zip(slope, start, strict=True)]
    best = int(np.argmin(errors))
    scale, shift = float(slope[best]), float(start[best])
    rows = np.stack([value, np.ones_like(value)], axis=1) / wanted[:, None]
    for _ in range(_ROUNDS):  # Cauchy's weights
        residual = rows @ [scale, shift] - 1.0
        spread = max(_spread(residual), 1e-4)
        weight = 1.0 / (1.0 + (residual / spread) ** 2)
        (scale, shift), *_ = np.linalg.lstsq(rows * np.sqrt(weight)[:, None], np.sqrt(weight), rcond=None)
    return (float(scale), float(shift)) if scale > 0.0 else None


def _spread(residual: np.ndarray) -> float:
    return _TO_SIGMA * float(np.median(np.abs(residual)))


def beside_edges(depth: np.ndarray) -> np.ndarray:
    """(H, W) bool: near a jump of depth, where estimates mix the two sides."""
    around = np.ones((3, 3), np.uint8)
    known = np.where(depth > 0.0, depth, np.nan)
    low = cv2.erode(np.nan_to_num(known, nan=np.inf).astype(np.float32), around)
    high = cv2.dilate(depth.astype(np.float32), around)
    side = 2 * max(1, round(_EDGE_REACH * max(depth.shape))) + 1
    return cv2.dilate((high / _JUMP > low).astype(np.uint8), np.ones((side, side), np.uint8)) > 0


def _levels(depth: np.ndarray, near_edge: np.ndarray, residual: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(H, W) what residuals say of the relative error at each distance, beside edges and away from them."""
    all_over = _spread(residual[known])
    bounds = np.quantile(depth[known], np.linspace(0.0, 1.0, _RANGES + 1)[1:-1])
    place = np.searchsorted(bounds, depth) + _RANGES * near_edge
    level = np.empty(2 * _RANGES)
    for index in range(2 * _RANGES):
        here = residual[known & (place == index)]
        usual = all_over * (2.0 if index >= _RANGES else 1.0)
        own = _spread(here) if len(here) else 0.0
        level[index] = np.sqrt((len(here) * own**2 + _AS_MANY * usual**2) / (len(here) + _AS_MANY))
    return level[place]


def _slow(residual: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What of the residuals varies slowly (H, W), and how far known ones tell it (H, W) in [0, 1]."""
    sigma = _REACH * max(residual.shape)
    limit = 3.0 * _spread(residual[known])
    kept = (known & (np.abs(residual) <= limit)).astype(np.float32)
    total, share = (cv2.GaussianBlur(part, (0, 0), sigma) for part in (residual * kept, kept))
    return total / (share + _HALF_KNOWN), share / (share + _HALF_KNOWN)


def _of_the_other_half(
    depth: np.ndarray, reference: np.ndarray, known: np.ndarray, residual: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) residuals of each half of the picture's blocks by what the other half says alone: of its scale and
    shift, and of what varies slowly besides. ``residual`` are those by all, for a half that nothing tells of."""
    side = max(1, round(max(depth.shape) / _BLOCKS))
    rows, columns = np.indices(depth.shape) // side
    half = (rows + columns) % 2 == 0
    alone, left = residual.copy(), residual.copy()
    for one in (half, ~half):
        teaching = known & ~one
        by = fitted(depth[teaching], reference[teaching]) if teaching.sum() >= _FEWEST else None
        if by is not None:
            off = _residual(by.of(depth), reference, known)
            alone[one] = off[one]
            left[one] = (off - _slow(off, teaching)[0])[one]
    return alone, left


def _residual(metres: np.ndarray, reference: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(H, W) float32 the logarithm of ``reference`` by ``metres`` where ``known``, 0 elsewhere."""
    ratio = np.where(known, reference, 1.0) / np.where(known, np.maximum(metres, 1e-6), 1.0)
    return np.where(known, np.log(ratio), 0.0).astype(np.float32)


def _beyond(depth: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(H, W) how many times less sure depth is beyond the distances that were known."""
    low, high = np.quantile(reference, [0.01, 0.99])
    inside = np.clip(depth, low, high)
    return 1.0 + 3.0 * np.abs(np.log(np.maximum(depth, 1e-6) / inside))
