"""Matches made exact to a fraction of a pixel, by aligning the photographs around them.

A learned matcher says which corner is which, to a pixel or so; where exactly, the photographs tell: the
patch around a feature is found again around its match by inverse compositional alignment of an affine
warp (Baker and Matthews, "Lucas-Kanade 20 Years On", IJCV 2004), which starts from how the matches
around it lie. All features of a track are aligned with one of them, so that they stay one point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import scipy.sparse
import scipy.sparse.csgraph
import scipy.spatial

from ...core.images import at_pixels
from .features import Features
from .overlap import Matched, Pairs

_RADIUS_PX = 10
_WINDOW_SIGMA = 0.6  # of the radius
_ITERATIONS = 12
# A match that moves farther, or whose patches are not alike in the end, stays where it was.
_FARTHEST_PX = 3.0
_LEAST_CORRELATION = 0.8
_ENOUGH = 100
# The warp around a match: of so many others, near a similarity of one where these say little.
_NEIGHBOURS = 12
_REWEIGHTED = 5
_LARGEST_STRETCH = 3.0


def align_matches(images: Sequence[np.ndarray], matched: Matched) -> Matched:
    """The matches of images (H, W, 3) uint8 whose surroundings agree, with their keypoints where these do.

    One feature of each track stays in its place. A pair of which fewer than ``_ENOUGH`` agree keeps all.
    """
    grey = [cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY).astype(np.float32) for image in images]
    given = [found.keypoints.astype(np.float64) for found in matched.features]
    places = [keypoints.copy() for keypoints in given]
    agree = [np.ones(len(keypoints), bool) for keypoints in given]
    for a, b, rows, of_a, of_b in _from_references(matched.pairs, [len(keypoints) for keypoints in given]):
        pair = matched.pairs[min(a, b), max(a, b)][:, :: 1 if a < b else -1]
        warps = _warps(given[a][pair[:, 0]], given[b][pair[:, 1]], rows)
        places[b][of_b], agree[b][of_b] = _aligned(grey[a], places[a][of_a], grey[b], places[b][of_b], warps)
    pairs = {}
    for (i, j), matches in matched.pairs.items():
        kept = matches[agree[i][matches[:, 0]] & agree[j][matches[:, 1]]]
        pairs[i, j] = kept if len(kept) >= _ENOUGH else matches
    features = [
        Features(keypoints.astype(np.float32), found.descriptors)
        for keypoints, found in zip(places, matched.features, strict=True)
    ]
    return Matched(features, pairs)


class _Step(NamedTuple):
    """Features ``of_b`` of image ``b`` are aligned with ``of_a`` of ``a``: ``rows`` of the pair's matches."""

    a: int
    b: int
    rows: np.ndarray
    of_a: np.ndarray
    of_b: np.ndarray


def _from_references(pairs: Pairs, counts: Sequence[int]) -> Iterator[_Step]:
    """What is aligned with what, from the feature of each track that most others match outwards."""
    starts = np.concatenate([[0], np.cumsum(counts)])
    edges = [
        np.column_stack([starts[i] + m[:, 0], starts[j] + m[:, 1], np.full(len(m), n), np.arange(len(m))])
        for n, ((i, j), m) in enumerate(sorted(pairs.items()))
    ]
    if not edges:
        return
    names = sorted(pairs)
    one, other, pair, row = np.concatenate(edges).T
    degree = np.bincount(np.concatenate([one, other]), minlength=starts[-1])
    graph = scipy.sparse.coo_array((np.ones(len(one), np.int8), (one, other)), (starts[-1], starts[-1]))
    _, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    nodes = np.flatnonzero(degree)
    order = nodes[np.lexsort((nodes, -degree[nodes], label[nodes]))]
    reached = np.zeros(starts[-1], bool)
    reached[order[np.unique(label[order], return_index=True)[1]]] = True
    while True:
        # Each feature once, from the first reached one that matches it.
        forth, back = reached[one] & ~reached[other], reached[other] & ~reached[one]
        edge = np.flatnonzero(forth | back)
        to = np.where(forth[edge], other[edge], one[edge])
        _, first = np.unique(to, return_index=True)
        edge, to = edge[first], to[first]
        if not len(edge):
            return
        for n in np.unique(pair[edge]):
            for forwards in (True, False):
                mine = edge[(pair[edge] == n) & (forth[edge] == forwards)]
                if len(mine):
                    i, j = names[n]
                    of_i, of_j = one[mine] - starts[i], other[mine] - starts[j]
                    yield _Step(i, j, row[mine], of_i, of_j) if forwards else _Step(j, i, row[mine], of_j, of_i)
        reached[to] = True


def _warps(a: np.ndarray, b: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(m, 2, 2): how what lies around ``rows`` (m,) of matches a, b (n, 2) changes from one image to the other."""
    _, near = scipy.spatial.cKDTree(a).query(a[rows], k=min(_NEIGHBOURS, len(a)))
    near = near.reshape(len(rows), -1)
    in_a, in_b = a[near] - a[rows, None], b[near] - b[rows, None]
    weight = np.ones(near.shape)
    prior = 0.4 * _RADIUS_PX**2 * np.eye(2)
    for _ in range(_REWEIGHTED):
        weighted = (in_a * weight[..., None]).transpose(0, 2, 1)
        warps = (weighted @ in_b + prior).transpose(0, 2, 1) @ _inverse(weighted @ in_a + prior)
        off = np.linalg.norm(in_b - in_a @ warps.transpose(0, 2, 1), axis=2)
        weight = (1.0 + (off / (2.0 + 0.05 * np.linalg.norm(in_a, axis=2))) ** 2) ** -2
    return warps


def _aligned(
    image_a: np.ndarray, a: np.ndarray, image_b: np.ndarray, b: np.ndarray, warps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places (m, 2) in one image that show what is at ``a`` (m, 2) in the other, near ``b``, else ``b``; and
    which of them (m,) do."""
    side = np.arange(-_RADIUS_PX, _RADIUS_PX + 1, dtype=np.float64)
    around = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    window = np.exp(-0.5 * (around**2).sum(axis=1) / (_WINDOW_SIGMA * _RADIUS_PX) ** 2)
    window /= window.sum()
    template, spread = _normalised(_sampled(image_a, a[:, None] + around), window)
    steps = [
        _sampled(image_a, a[:, None] + around + half) - _sampled(image_a, a[:, None] + around - half)
        for half in (np.array([0.5, 0.0]), np.array([0.0, 0.5]))
    ]
    slope = np.stack(steps, axis=2) / spread[..., None]
    # Derivatives by the shift and by the four terms of the warp, whose unit is the window's radius.
    by_warp = slope[..., :, None] * (around / _RADIUS_PX)[:, None, :]
    jacobian = np.concatenate([slope, by_warp.reshape(*slope.shape[:2], 4)], axis=2)
    weighted = (jacobian * window[:, None]).transpose(0, 2, 1)
    hessian = weighted @ jacobian
    hessian += 0.01 * np.trace(hessian, axis1=1, axis2=2)[:, None, None] / 6.0 * np.eye(6) + 1e-9 * np.eye(6)
    gain = _inverse(hessian) @ weighted
    places, warps = b.copy(), warps.copy()
    before = None
    for _ in range(_ITERATIONS):
        seen, _ = _normalised(_sampled(image_b, places[:, None] + around @ warps.transpose(0, 2, 1)), window)
        before = (seen * template) @ window if before is None else before
        terms = (gain @ (seen - template)[..., None])[..., 0]
        undone = _inverse(np.eye(2) + np.clip(terms[:, 2:] / _RADIUS_PX, -0.4, 0.4).reshape(-1, 2, 2))
        warps = warps @ undone
        places = places - (warps @ terms[:, :2, None])[..., 0]
    seen, _ = _normalised(_sampled(image_b, places[:, None] + around @ warps.transpose(0, 2, 1)), window)
    after = (seen * template) @ window
    stretch = np.abs(warps[:, 0, 0] * warps[:, 1, 1] - warps[:, 0, 1] * warps[:, 1, 0])
    fits = (after >= _LEAST_CORRELATION) & (after >= before)
    fits &= np.linalg.norm(places - b, axis=1) <= _FARTHEST_PX
    fits &= (stretch < _LARGEST_STRETCH) & (stretch > 1.0 / _LARGEST_STRETCH)
    return np.where(fits[:, None], places, b), fits


def _sampled(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(m, p) float64 values of an image (H, W) at pixels (m, p, 2)."""
    return at_pixels(image, pixels.reshape(-1, 2)).reshape(pixels.shape[:2]).astype(np.float64)


def _normalised(patches: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Patches (m, p) without their mean and of one spread, and the spread (m, 1): exposures may differ."""
    patches = patches - (patches @ window)[:, None]
    spread = np.maximum(np.sqrt(patches**2 @ window), 1e-3)[:, None]
    return patches / spread, spread


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Of matrices (m, n, n) whose diagonals dominate, all at once: LAPACK takes them one by one."""
    count = matrices.shape[1]
    rows = np.concatenate([matrices, np.broadcast_to(np.eye(count), matrices.shape)], axis=2)
    for k in range(count):
        rows[:, k] /= rows[:, k, k, None]
        others = np.arange(count) != k
        rows[:, others] -= rows[:, others, k, None] * rows[:, None, k]
    return rows[:, :, count:]
