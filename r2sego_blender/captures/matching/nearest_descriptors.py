"""The nearest of two images' descriptors, in squared distances that are exact integers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...core.compiled import kernel

_RULED_OUT = np.int32(2**31 - 1)  # the squared distance of a pair that may not be matched


class Best(NamedTuple):
    """Of each descriptor of a its ``nearest`` in b, with the squared distances of this and of the
    second nearest, and of each in b its nearest in a, ``owner``; all int32, the first of equals."""

    nearest: np.ndarray
    first: np.ndarray
    second: np.ndarray
    closest: np.ndarray
    owner: np.ndarray

    @staticmethod
    def of(count_a: int, count_b: int) -> Best:
        far_a, far_b = np.full(count_a, _RULED_OUT), np.full(count_b, _RULED_OUT)
        return Best(np.zeros(count_a, np.int32), far_a, far_a.copy(), far_b, np.full(count_b, -1, np.int32))

    def pairs(self, ratio: float, mutual: bool) -> np.ndarray:
        """Index pairs (m, 2) int32 that pass the ratio test, in the order of a."""
        first, second = (
            np.where(squared == _RULED_OUT, np.inf, squared).astype(np.float32) for squared in (self.first, self.second)
        )
        passes = np.isfinite(first) & (first < ratio * ratio * second)
        if mutual:
            passes &= self.owner[self.nearest] == np.arange(len(first))
        kept = np.flatnonzero(passes)
        return np.stack([kept, self.nearest[kept]], axis=1).astype(np.int32)


@kernel
def compare(products, squares_a, squares_b, start, nearest, first, second, closest, owner):
    """Enter a block of inner products (r, k), of the descriptors of a from ``start`` on, into a ``Best``."""
    squared = np.empty(len(squares_b), np.int32)
    for row in range(len(products)):
        index = np.int32(start + row)
        least = _RULED_OUT
        for j in range(len(squares_b)):
            here = squares_a[index] + squares_b[j] - np.int32(2) * np.int32(products[row, j])
            squared[j] = here
            least = min(least, here)
            nearer = here < closest[j]
            closest[j] = here if nearer else closest[j]
            owner[j] = index if nearer else owner[j]
        at = 0
        while squared[at] != least:
            at += 1
        squared[at] = _RULED_OUT
        following = _RULED_OUT
        for j in range(len(squares_b)):
            following = min(following, squared[j])
        nearest[index], first[index], second[index] = at, least, following


@kernel
def compare_near(
    in_b, in_a, max_error_px, desc_a, desc_b, squares_a, squares_b, start, nearest, first, second, closest, owner
):
    """As ``compare``, of those pairs alone whose distances (r, k) from both epipolar lines are small."""
    for row in range(len(in_b)):
        index = start + row
        for j in range(len(squares_b)):
            if abs(in_b[row, j]) > max_error_px or abs(in_a[row, j]) > max_error_px:
                continue
            product = np.int32(0)
            for k in range(desc_a.shape[1]):
                product += np.int32(desc_a[index, k]) * np.int32(desc_b[j, k])
            here = squares_a[index] + squares_b[j] - np.int32(2) * product
            if here < first[index]:
                nearest[index], first[index], second[index] = j, here, first[index]
            elif here < second[index]:
                second[index] = here
            if here < closest[j]:
                closest[j], owner[j] = here, index
