"""What contradicts an estimate: free space that other captures see through, nearer surfaces, other estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from ..stereo.evidence import FREE_MARGIN, KnownDepth, collect_votes, seen_by_others
from .aligned_depth import AlignedDepth

_SIGMAS = 2.0  # by which an estimate may be off before it contradicts
_WRONG_SIGMAS = 4.0  # of known depth, at which an estimate does not show what is there
_MOST_DOUBT = 0.1
_WINDOW = 0.02  # half side, of the longest side
_MOSTLY = 0.5
_LEAST_SHARED = 0.003  # of the picture, by which two estimates are compared as wholes
_OTHER_SCALE = 0.25  # of the logarithm: no scale that fits both


def contradicted(estimates: Mapping[int, AlignedDepth]) -> list[int]:
    """The captures whose estimates, as wholes, show another depth of what they share with others than those do.

    Taken away one by one, the most contradicted first, until all that are left agree.
    """
    apart = {(i, j) for i in estimates for j in estimates if i != j and _differ(estimates[i], estimates[j])}
    away: list[int] = []
    while apart:
        worst = max(estimates, key=lambda index: sum(index in pair for pair in apart))
        away.append(worst)
        apart = {pair for pair in apart if worst not in pair}
    return away


def _differ(one: AlignedDepth, other: AlignedDepth) -> bool:
    seen = seen_by_others(one.camera, [KnownDepth(other.camera, other.depth)], np.zeros_like(one.depth))
    both = (seen > 0.0) & (one.depth > 0.0)
    if both.sum() < _LEAST_SHARED * both.size:
        return False
    return bool(abs(np.median(np.log(seen[both] / one.depth[both]))) > _OTHER_SCALE)


def without_contradictions(
    estimates: Sequence[AlignedDepth], trusted: Sequence[KnownDepth]
) -> tuple[AlignedDepth, ...]:
    """The estimates less what the captures' ``trusted`` depth, at their size, or each other contradict."""
    kept = [_against_trusted(index, estimates, trusted) for index in range(len(estimates))]
    return tuple(_against_estimates(index, kept) for index in range(len(kept)))


def _against_trusted(index: int, estimates: Sequence[AlignedDepth], trusted: Sequence[KnownDepth]) -> AlignedDepth:
    one = estimates[index]
    if not one.depth.any():
        return one
    others = [view for j, view in enumerate(trusted) if j != index]
    valid = (one.depth > 0.0) & ~_mostly_wrong(one, trusted[index].depth)
    behind = seen_by_others(one.camera, others, trusted[index].depth)
    valid &= ~((behind > 0.0) & (one.depth > behind * (1.0 + FREE_MARGIN + _SIGMAS * _doubt(one))))
    valid[valid] = ~_seen_through(one, valid, others, FREE_MARGIN)
    return _only(one, valid)


def _against_estimates(index: int, estimates: Sequence[AlignedDepth]) -> AlignedDepth:
    one = estimates[index]
    valid = one.depth > 0.0
    if not valid.any():
        return one
    others = [KnownDepth(view.camera, view.depth) for j, view in enumerate(estimates) if j != index]
    sigma = np.concatenate([view.sigma[view.depth > 0.0] for j, view in enumerate(estimates) if j != index])
    tolerance = FREE_MARGIN + _SIGMAS * float(np.median(sigma)) if len(sigma) else FREE_MARGIN
    valid[valid] = ~_seen_through(one, valid, others, tolerance)
    return _only(one, valid)


def _seen_through(one: AlignedDepth, asked: np.ndarray, others: Sequence[KnownDepth], tolerance: float) -> np.ndarray:
    """(n,) bool of the pixels ``asked``: more captures see through them, moved back by their doubt, than see them."""
    agree = collect_votes(one.camera.unproject(one.depth)[asked], others, tolerance).agree
    farther = one.camera.unproject(one.depth * (1.0 + _SIGMAS * _doubt(one)))[asked]
    return collect_votes(farther, others, tolerance).through > agree


def _mostly_wrong(one: AlignedDepth, trusted: np.ndarray) -> np.ndarray:
    """(H, W) bool: around here most known depth says that the estimate shows something else."""
    both = (trusted > 0.0) & (one.depth > 0.0)
    off = np.abs(np.log(np.where(both, one.depth, 1.0) / np.where(both, trusted, 1.0)))
    wrong = both & (off > FREE_MARGIN + _WRONG_SIGMAS * _doubt(one))
    side = 2 * max(1, round(_WINDOW * max(one.depth.shape))) + 1
    share, known = (cv2.boxFilter(mask.astype(np.float32), -1, (side, side)) for mask in (wrong, both))
    mostly: np.ndarray = share > np.maximum(_MOSTLY * known, 1e-6)
    return mostly


def _doubt(one: AlignedDepth) -> np.ndarray:
    """(H, W) the estimate's sigma, as far as it excuses anything: what is wrong everywhere says it is unsure."""
    return np.minimum(one.sigma, np.float32(_MOST_DOUBT))


def _only(one: AlignedDepth, valid: np.ndarray) -> AlignedDepth:
    zero = np.float32(0.0)
    return replace(one, depth=np.where(valid, one.depth, zero), sigma=np.where(valid, one.sigma, zero))
