"""Which of many pictures of a room to keep: sharp ones, that overlap and show it from many places."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components

_FEATURES = 500
_MAX_RATIO = 0.8
_MAX_ERROR_PX = 3.0
_FEWEST_MATCHES = 15
# What one plane or a turn on the spot explains is seen without parallax: such pictures are more alike.
_PARALLAX_LIKENESS = 0.5
_NEIGHBOURS = 4
_BLURRED = 0.4
"""Of the neighbours' median sharpness; what is less sharp is blurred, whatever it shows."""

_CLEARLY_SHARPER = 1.5
# How alike pictures are that hold others together, from what poses are solved with ease to what is just seen.
_LINKS = (0.2, 0.1, 0.05, 0.0)


def sharpest_of_parts(ways: np.ndarray, sharpness: np.ndarray, parts: int) -> np.ndarray:
    """The sharpest picture of each of so many parts of a walk, as rising indices, at most ``parts``.

    ``ways`` (n,) is how far the camera moved before each picture, in any unit, NaN where nobody knows;
    the parts are equally long. ``sharpness`` (n,) is any measure that may be compared among neighbours.
    """
    known = ways[np.isfinite(ways)]
    usual = float(np.median(known)) if len(known) else 1.0
    # A little for time itself: where the camera rests, one picture may still be sharper than the others.
    along = np.cumsum(np.where(np.isfinite(ways), ways, usual) + 0.1 * usual + 1e-12)
    part = np.minimum((along - along[0]) / max(along[-1] - along[0], 1e-12) * parts, parts - 1).astype(int)
    return np.array([np.flatnonzero(part == p)[np.argmax(sharpness[part == p])] for p in np.unique(part)])


def likeness(greys: Sequence[np.ndarray]) -> np.ndarray:
    """(n, n) in [0, 1]: how much of their ORB features two pictures share, less where there is parallax.

    ``greys`` are (H, W) uint8. 0 on the diagonal, and where no two-view geometry is found.
    """
    detector = cv2.ORB.create(_FEATURES, fastThreshold=10)
    found = []
    for grey in greys:
        points, descriptors = detector.detectAndCompute(grey, None)  # type: ignore[call-overload]  # whose types know no None
        pixels = np.array([point.pt for point in points], np.float32).reshape(-1, 2)
        found.append((pixels, descriptors))
    alike = np.zeros((len(greys), len(greys)))
    for i in range(len(greys)):
        for j in range(i):
            alike[i, j] = alike[j, i] = _pair_likeness(*found[i], *found[j])
    return alike


def _pair_likeness(
    pixels_i: np.ndarray, descriptors_i: np.ndarray | None, pixels_j: np.ndarray, descriptors_j: np.ndarray | None
) -> float:
    if descriptors_i is None or descriptors_j is None or min(len(pixels_i), len(pixels_j)) < _FEWEST_MATCHES:
        return 0.0
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors_i, descriptors_j, k=2)
    good = [best for best, second in pairs if best.distance < _MAX_RATIO * second.distance]
    if len(good) < _FEWEST_MATCHES:
        return 0.0
    ours, theirs = pixels_i[[one.queryIdx for one in good]], pixels_j[[one.trainIdx for one in good]]
    # OpenCV's RANSAC begins from the same seed each time.
    _, agreeing = cv2.findFundamentalMat(ours, theirs, cv2.FM_RANSAC, _MAX_ERROR_PX, 0.99, 500)
    if agreeing is None or agreeing.sum() < _FEWEST_MATCHES:
        return 0.0
    _, flat = cv2.findHomography(ours, theirs, cv2.RANSAC, _MAX_ERROR_PX, maxIters=500)
    without = 0 if flat is None else int(flat.sum())
    shared = max(int(agreeing.sum()), without)
    weighed = without + _PARALLAX_LIKENESS * (shared - without)
    return min(1.0, weighed / min(len(pixels_i), len(pixels_j)))


def thinned(alike: np.ndarray, sharpness: np.ndarray, count: int) -> np.ndarray:
    """The ``count`` pictures to keep, as rising indices.

    ``alike`` (n, n) is their likeness, ``sharpness`` (n,) as for ``sharpest_of_parts``; they come in
    an order in which neighbours show much the same. First go those that share nothing with any other,
    then those that are blurred, and then again and again one of the two that are most alike, as long as what is
    left hangs together: by much that is shared while there are such to spare, then by less. Where all are links
    of a chain, it is shortened.
    """
    kept = list(range(len(sharpness)))
    alone = [i for i in kept if alike[i].max(initial=0.0) <= 0.0]
    relative = np.array([sharpness[i] / max(_median_around(sharpness, i), 1e-12) for i in kept])
    blurred = [i for i in kept if relative[i] < _BLURRED and i not in alone]
    for one in [*alone, *sorted(blurred, key=lambda i: (relative[i], i))]:
        if len(kept) > count:
            kept.remove(one)
    for linked in _LINKS:
        while len(kept) > count and (spare := _spare(alike, sharpness, kept, linked)) is not None:
            kept.remove(spare)
    while len(kept) > count:
        kept.remove(_end(alike, kept))
    return np.array(kept)


def _spare(alike: np.ndarray, sharpness: np.ndarray, kept: Sequence[int], linked: float) -> int | None:
    """Of the two most alike the one that is missed less; None where each is needed to hold others together.

    Two pictures are linked that are alike by more than ``linked``; what less holds together still does.
    """
    among = alike[np.ix_(kept, kept)]
    links, weak_links = among > linked, among > 0.0
    pairs = np.argwhere(np.triu(links))
    for i, j in pairs[np.argsort(-among[tuple(pairs.T)], kind="stable")]:
        ratio = sharpness[kept[i]] / max(sharpness[kept[j]], 1e-12)
        if not 1.0 / _CLEARLY_SHARPER <= ratio <= _CLEARLY_SHARPER:
            first = i if ratio < 1.0 else j
        else:  # the one that is more alike to the others, too
            others = [np.delete(among[row], [i, j]).max(initial=0.0) for row in (i, j)]
            first = i if others[0] >= others[1] else j
        for one in (first, i + j - first):
            if _hold_together(links, one) and _hold_together(weak_links, one):
                return kept[one]
    return None


def _hold_together(links: np.ndarray, without: int) -> bool:
    """Whether the pictures that are linked with one, two at least, are linked with each other by others."""
    around = np.flatnonzero(links[without])
    others = links.copy()
    others[without] = others[:, without] = False
    _, group = connected_components(others, directed=False)
    return len(around) >= 2 and len(set(group[around])) == 1


def _end(alike: np.ndarray, kept: Sequence[int]) -> int:
    """Of the fewest that hang together the one that is linked with fewest, and of these shares most with another."""
    among = alike[np.ix_(kept, kept)]
    links = among > 0.0
    _, group = connected_components(links, directed=False)
    sizes = np.bincount(group)[group]
    return kept[int(np.lexsort((-among.max(axis=1), links.sum(axis=1), sizes))[0])]


def _median_around(values: np.ndarray, index: int) -> float:
    return float(np.median(values[max(0, index - _NEIGHBOURS) : index + _NEIGHBOURS + 1]))
