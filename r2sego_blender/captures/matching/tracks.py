"""Matches that two photographs agree on whatever their poses and lenses, and tracks of them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from .features import Features
from .overlap import Pairs

# A fundamental matrix fits a lens that distorts by some per cent only so well.
_ERROR_PX = 3.0
_CONFIDENCE, _MOST_TRIALS = 0.9999, 5000
_FEWEST = 8


def verified(plain: Pairs, features: Sequence[Features], min_matches: int) -> Pairs:
    """Of the matches of each pair those that one fundamental matrix explains, where these are ``min_matches``.

    No pose and no focal length is looked at. The same matches give the same ones (OpenCV's USAC with MAGSAC
    scores, Barath et al. 2020, starts from one seed).
    """
    pairs: Pairs = {}
    for (i, j), matches in plain.items():
        if len(matches) < max(min_matches, _FEWEST):
            continue
        a, b = (features[k].keypoints[matches[:, side]].astype(np.float64) for side, k in enumerate((i, j)))
        try:
            _, agree = cv2.findFundamentalMat(a, b, cv2.USAC_MAGSAC, _ERROR_PX, _CONFIDENCE, _MOST_TRIALS)
        except cv2.error:  # its assertion that a model was found
            continue
        kept = matches[agree.ravel().astype(bool)] if agree is not None else matches[:0]
        if len(kept) >= min_matches:
            pairs[i, j] = kept
    return pairs


def tracks_of(pairs: Pairs, features: Sequence[Features]) -> np.ndarray:
    """(P, N, 2) float64 pixels of what matches join, NaN where a photograph has no part in it.

    A track of two features of one photograph is none. Longest first, then by its first feature.
    """
    counts = [len(found.keypoints) for found in features]
    starts = np.concatenate([[0], np.cumsum(counts)])
    ends = [(starts[i] + m[:, 0], starts[j] + m[:, 1]) for (i, j), m in sorted(pairs.items())]
    if not ends:
        return np.zeros((0, len(features), 2))
    a, b = (np.concatenate(side).astype(np.int64) for side in zip(*ends, strict=True))
    graph = scipy.sparse.coo_array((np.ones(len(a), np.int8), (a, b)), (starts[-1], starts[-1]))
    _, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    nodes = np.unique(np.concatenate([a, b]))
    owner = np.searchsorted(starts, nodes, side="right") - 1
    _, first, track = np.unique(label[nodes], return_index=True, return_inverse=True)
    keys, times = np.unique(track * len(features) + owner, return_counts=True)
    spoilt = np.zeros(len(first), bool)
    spoilt[keys[times > 1] // len(features)] = True
    length = np.bincount(track)
    order = np.lexsort((nodes[first], -length))
    order = order[~spoilt[order]]
    row = np.full(len(first), -1)
    row[order] = np.arange(len(order))
    pixels = np.full((len(order), len(features), 2), np.nan)
    places = np.concatenate([found.keypoints for found in features])
    kept = row[track] >= 0
    pixels[row[track[kept]], owner[kept]] = places[nodes[kept]]
    return pixels
