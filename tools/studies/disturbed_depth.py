"""True depth disturbed as models of one photograph disturb it, by a stated mean relative error.

Models are compared by AbsRel, the mean of ``|estimate / truth - 1|`` after a scale and shift, so that is the size of a
disturbance here: a model's own table says where in the study's it stands.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

ALL = "all"

_CELLS = (5, 6)  # rows and columns of the grid whose values a smooth error takes
_MOST_SHIFT = 0.5  # of a scale's error, in parts of the median depth
_LEAST_LEFT = 0.05  # of a depth that a shift takes away
_PATCHES = 400
_PATCH_RADII = (0.03, 0.1)  # of the longest side
_PATCH_OFF = 0.25  # relative, of a flat failure besides that it is flat
_LOCAL_SHARE = 0.25  # of the error of all kinds together, that edges and flat failures have each
_MOST = {"scale": 0.9, "smooth": 2.0, "edges": 0.06, "flat": float(_PATCHES)}
_STEPS = 16

Manner = Callable[[float], np.ndarray]
"""Of an amount, the disturbed map: none at 0, and the more the farther off."""


def disturbed(true: np.ndarray, kind: str, error: float, rng: np.random.Generator) -> np.ndarray:
    """``true`` (H, W) metres, 0 unknown, off by the mean relative ``error`` in the manner of ``kind``; float32.

    What is known stays known and nothing else becomes it. Of ``all`` the error is that without its scale and shift. The
    same generator gives the same map. An error that a kind does not reach in a picture is as large as it gets: there
    are only so many edges.
    """
    known = true > 0.0
    depth = np.where(known, true, 1.0).astype(np.float64)
    if not known.any():
        return true.astype(np.float32)
    middle = float(np.median(depth[known]))
    if kind != ALL:
        return _only(_off_by(error, kind, _MANNERS[kind](depth, known, rng), depth, known), known)
    changed = depth
    for local in ("edges", "flat"):
        changed = _off_by(_LOCAL_SHARE * error, local, _MANNERS[local](changed, known, rng), changed, known)
    changed = _off_by(error, "smooth", _MANNERS["smooth"](changed, known, rng), depth, known)
    return _only(rng.uniform(0.3, 3.0) * (changed + rng.uniform(0.0, 0.2) * middle), known)


def mean_relative_error(depth: np.ndarray, true: np.ndarray) -> float:
    """AbsRel of ``depth`` over the pixels of ``true`` (H, W both, one unit) where both are positive; 0 without any."""
    both = (depth > 0.0) & (true > 0.0)
    return float(np.abs(depth[both] / true[both] - 1.0).mean()) if both.any() else 0.0


def _off_by(error: float, kind: str, made: Manner, true: np.ndarray, known: np.ndarray) -> np.ndarray:
    """What is made of the amount at which the mean relative error is ``error``, by bisection."""
    low, high = 0.0, _MOST[kind]
    for _ in range(_STEPS):
        middle = (low + high) / 2.0
        off = np.abs(made(middle)[known] / true[known] - 1.0).mean()
        low, high = (middle, high) if off < error else (low, middle)
    return made(low)


def _only(depth: np.ndarray, known: np.ndarray) -> np.ndarray:
    return np.where(known, depth, 0.0).astype(np.float32)


def _scaled(depth: np.ndarray, known: np.ndarray, rng: np.random.Generator) -> Manner:
    """A scale and a shift of the whole map, which alignment can take away."""
    sign, part = rng.choice([-1.0, 1.0]), rng.uniform(0.0, _MOST_SHIFT)
    shift = part * np.median(depth[known])
    return lambda amount: np.maximum(depth + sign * amount * ((1.0 - part) * depth + shift), _LEAST_LEFT * depth)


def _smooth(depth: np.ndarray, known: np.ndarray, rng: np.random.Generator) -> Manner:
    """An error that varies over a fifth of the picture."""
    height, width = depth.shape
    field = cv2.resize(rng.standard_normal(_CELLS).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    centred = field - np.median(field[known])
    return lambda amount: depth * np.exp(amount * centred)


def _edges(depth: np.ndarray, known: np.ndarray, rng: np.random.Generator) -> Manner:
    """Both sides of a depth edge mixed, by a blur; what is not known takes no part."""
    weight = known.astype(np.float64)

    def blurred(amount: float) -> np.ndarray:
        sigma = max(amount * max(depth.shape), 1e-3)
        total, share = (cv2.GaussianBlur(part, (0, 0), sigma) for part in (depth * weight, weight))
        return np.where(known, total / np.maximum(share, 1e-9), depth)

    return blurred


def _flat(depth: np.ndarray, known: np.ndarray, rng: np.random.Generator) -> Manner:
    """Patches that face the camera, each at one depth near or far of its own: as mirrors, pictures and dark things
    are seen. The amount is their number, the last of them as large as the fraction says."""
    height, width = depth.shape
    centres = rng.uniform(0.0, 1.0, (_PATCHES, 2)) * [width, height]
    radii = rng.uniform(*_PATCH_RADII, (_PATCHES, 2)) * max(height, width)
    factors = np.exp(rng.choice([-1.0, 1.0], _PATCHES) * _PATCH_OFF)

    def flattened(amount: float) -> np.ndarray:
        changed = depth.copy()
        whole = int(amount)
        for index in range(min(whole + 1, _PATCHES)):
            size = 1.0 if index < whole else np.sqrt(amount - whole)
            (x, y), (a, b) = centres[index], radii[index] * size
            left, right, top, bottom = (int(v) for v in (max(x - a, 0), x + a + 1, max(y - b, 0), y + b + 1))
            rows, columns = np.ogrid[top : min(bottom, height), left : min(right, width)]
            inside = known[top:bottom, left:right] & (
                ((columns + 0.5 - x) / max(a, 1e-9)) ** 2 + ((rows + 0.5 - y) / max(b, 1e-9)) ** 2 < 1.0
            )
            if inside.any():
                changed[top:bottom, left:right][inside] = factors[index] * np.median(
                    depth[top:bottom, left:right][inside]
                )
        return changed

    return flattened


_MANNERS: dict[str, Callable[[np.ndarray, np.ndarray, np.random.Generator], Manner]] = {
    "scale": _scaled,
    "smooth": _smooth,
    "edges": _edges,
    "flat": _flat,
}
KINDS = (*_MANNERS, ALL)
"""The four, and ``all``: edges, flat failures and a smooth error, in a unit and with a shift of its own."""
