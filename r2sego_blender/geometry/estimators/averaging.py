"""Estimates of one place by several captures, brought together: their errors are not the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from ..stereo.evidence import KnownDepth, seen_by_others
from .aligned_depth import AlignedDepth

_SIGMAS = 2.0  # of both, within which two estimates show one surface
_REACH = 0.02  # sigma, of the longest side, over which their difference is averaged
_LEAST_SHARE = 0.1  # of the pixels there that both show
_SHARED = 0.5  # of an estimator's variance that all its estimates have in common


def brought_together(estimates: Sequence[AlignedDepth]) -> tuple[AlignedDepth, ...]:
    """The estimates moved to what all captures say of a surface, each weighed by its certainty.

    Only differences that vary slowly over the picture are evened out, and only where captures agree within their
    doubt.
    """
    return tuple(_with_others(index, estimates) for index in range(len(estimates)))


def _with_others(index: int, estimates: Sequence[AlignedDepth]) -> AlignedDepth:
    one = estimates[index]
    known = one.depth > 0.0
    own = np.where(known, 1.0 / np.maximum(one.sigma, 1e-6) ** 2, 0.0)
    weight, moved = own.copy(), np.zeros(one.depth.shape)
    for j, other in enumerate(estimates):
        if j == index or not known.any() or not other.depth.any():
            continue
        seen = seen_by_others(one.camera, [KnownDepth(other.camera, other.depth)], np.zeros_like(one.depth))
        both = known & (seen > 0.0)
        doubt = float(np.median(other.sigma[other.depth > 0.0]))
        apart = np.log(np.where(both, seen, 1.0) / np.where(both, one.depth, 1.0))
        both &= np.abs(apart) < _SIGMAS * np.hypot(one.sigma, doubt)
        size = _REACH * max(one.depth.shape)
        share, total = (
            cv2.GaussianBlur(part.astype(np.float32), (0, 0), size) for part in (both, np.where(both, apart, 0.0))
        )
        shown = known & (share > _LEAST_SHARE)
        counts = np.where(shown, 1.0 / doubt**2, 0.0)
        moved += counts * total / np.maximum(share, _LEAST_SHARE)
        weight += counts
    depth = np.where(known, one.depth * np.exp(moved / np.maximum(weight, 1e-12)), 0.0)
    left = _SHARED + (1.0 - _SHARED) * own / np.maximum(weight, 1e-12)
    return replace(
        one, depth=depth.astype(np.float32), sigma=np.where(known, one.sigma * np.sqrt(left), 0.0).astype(np.float32)
    )
