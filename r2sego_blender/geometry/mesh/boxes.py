"""Many boxes along the axes, and which of them a box meets, found through a grid seen from above."""

from __future__ import annotations

import numpy as np

_CELLS = 256  # along the longer side of the grid
_WIDEST_CELLS = 4  # what reaches farther is asked every time


class Boxes:
    """Boxes from ``low`` to ``high``, both (B, d) with d of 2 or 3, in a grid over x and y."""

    def __init__(self, low: np.ndarray, high: np.ndarray) -> None:
        self.low, self.high = low, high
        if not len(low):
            return
        self._corner = low[:, :2].min(0)
        size = high[:, :2].max(0) - self._corner
        self._cell = max(float(size.max()) / _CELLS, 1e-9)
        self._shape = np.floor(size / self._cell).astype(np.int64) + 1
        first, last = self._cells(low[:, :2]), self._cells(high[:, :2])
        wide = (last - first >= _WIDEST_CELLS).any(1)
        self._wide = np.flatnonzero(wide)
        self._boxes, cells = self._in_cells(np.flatnonzero(~wide), first, last)
        order = np.argsort(cells, kind="stable")
        self._boxes = self._boxes[order]
        self._starts = np.searchsorted(cells[order], np.arange(self._shape.prod() + 1))

    def meeting(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(K,) ascending indices of the boxes that meet the box from ``start`` to ``end`` (d,)."""
        if not len(self.low):
            return np.zeros(0, np.int64)
        (i, j), (right, ahead) = self._cells(np.stack([start, end])[:, :2])
        rows = np.arange(i, right + 1) * self._shape[1]
        found = [self._boxes[self._starts[row + j] : self._starts[row + ahead + 1]] for row in rows]
        near = np.unique(np.concatenate([self._wide, *found]))
        return near[touched(self.low[near], self.high[near], start, end)]

    def _cells(self, places: np.ndarray) -> np.ndarray:
        """(N, 2) int64 cells of places (N, 2); those outside belong to the border's."""
        cells = np.floor((places - self._corner) / self._cell)
        return np.clip(cells, 0, self._shape - 1).astype(np.int64)

    def _in_cells(self, boxes: np.ndarray, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Boxes, each once for every cell it lies in, and these cells' numbers."""
        found, cells = [], []
        for i in range(_WIDEST_CELLS):
            for j in range(_WIDEST_CELLS):
                inside = boxes[(first[boxes] + (i, j) <= last[boxes]).all(1)]
                found.append(inside)
                cells.append((first[inside] + (i, j)) @ (self._shape[1], 1))
        return np.concatenate(found), np.concatenate(cells)


def touched(low: np.ndarray, high: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(B,) bool: boxes from ``low`` to ``high`` (B, d) that meet the box from start to end."""
    met = (low[:, 0] <= end[0]) & (high[:, 0] >= start[0])
    for axis in range(1, low.shape[1]):
        met &= (low[:, axis] <= end[axis]) & (high[:, axis] >= start[axis])
    return met
