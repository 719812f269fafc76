"""Pairs of photographs that only look alike, since something in the room repeats itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from .features import match
from .overlap import Matched

# A ratio test drops what repeats, for its second best is as good; a matcher that weighs whole neighbourhoods
# takes the pattern of a wallpaper for one place, by hundreds of matches that fit together. Pairs that overlap
# share a few distinct features at least: more than two are no chance.
_LEAST_DISTINCT = 3
_PLENTY = 100  # so many of SIFT's matches in a pair are no mistake
# In shares of the longest side: how near to a match a distinct one begins, and how alike it moves.
_BESIDE, _ALIKE = 0.03, 0.015


def without_repetition(found: Matched, by_sift: Matched, sizes: Sequence[tuple[int, int]], ratio: float) -> Matched:
    """The pairs of ``found`` that SIFT's matches of the same photographs under the ratio test confirm.

    Pairs that ``by_sift`` leaves out, as ``match_all`` does those of few matches, are matched here. ``sizes``
    (width, height) are in the pixels of the keypoints.
    """
    pairs = {}
    for (i, j), matches in found.pairs.items():
        a, b = by_sift.features[i], by_sift.features[j]
        known = by_sift.pairs.get((i, j))
        distinct = match(a.descriptors, b.descriptors, ratio) if known is None else known
        ends = a.keypoints[distinct[:, 0]], b.keypoints[distinct[:, 1]]
        others = found.features[i].keypoints[matches[:, 0]], found.features[j].keypoints[matches[:, 1]]
        if _distinct_beside(ends, others, max(sizes[i])) >= _LEAST_DISTINCT:
            pairs[i, j] = matches
    return Matched(found.features, pairs)


def confirmed_sift(by_sift: Matched, found: Matched) -> Matched:
    """The pairs of ``by_sift`` that ``found`` has too, or that have plenty of matches; and all of a photograph that has
    no such pair, which nothing surer contradicts.

    Corners of a pattern pass the ratio test here and there, by a few dozen matches that lie on one wall.
    """
    sure = {pair for pair, rows in by_sift.pairs.items() if len(rows) >= _PLENTY} | found.pairs.keys()
    placed = {index for pair in sure for index in pair}
    pairs = {pair: rows for pair, rows in by_sift.pairs.items() if pair in sure or not placed.issuperset(pair)}
    return Matched(by_sift.features, pairs)


def _distinct_beside(
    distinct: tuple[np.ndarray, np.ndarray], matches: tuple[np.ndarray, np.ndarray], longest_px: int
) -> int:
    """How many distinct matches (m, 2) px of two photographs lie beside others (n, 2) px, and move alike."""
    if not len(distinct[0]):
        return 0
    distance, nearest = cKDTree(matches[0]).query(distinct[0])
    off = (distinct[1] - distinct[0]) - (matches[1] - matches[0])[nearest]
    return int(((distance < _BESIDE * longest_px) & (np.linalg.norm(off, axis=1) < _ALIKE * longest_px)).sum())
