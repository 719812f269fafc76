"""Where on the floor of a true surface somebody can stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

CELL_M = 0.04
_ON_FLOOR_M = 0.06
_HEAD_M = 1.75
_ACROSS_M = CELL_M / 2.0  # between samples of a face


@dataclass(frozen=True)
class FreeFloor:
    """Clearance of the floor's cells.

    ``clearance_m`` (X, Y) float64: metres from a cell's middle to what stands up to head height, 0 where
    there is no floor or no way from the room's middle; ``origin`` (2,) is the first cell's corner.
    """

    clearance_m: np.ndarray
    origin: np.ndarray

    def places(self, clearance_m: float) -> np.ndarray:
        """(P, 2) metres: the middles of all cells with that clearance."""
        middles: np.ndarray = self.origin + (np.argwhere(self.clearance_m >= clearance_m) + 0.5) * CELL_M
        return middles

    def at(self, places: np.ndarray) -> np.ndarray:
        """(P,) clearance at places (P, 2), metres; 0 outside."""
        cell = np.floor((places - self.origin) / CELL_M).astype(int)
        inside = ((cell >= 0) & (cell < self.clearance_m.shape)).all(axis=-1)
        cell = np.where(inside[..., None], cell, 0)
        return np.where(inside, self.clearance_m[cell[..., 0], cell[..., 1]], 0.0)


def free_floor(vertices: np.ndarray, faces: np.ndarray, low: np.ndarray, high: np.ndarray) -> FreeFloor:
    """The floor at z = 0 between the corners ``low`` and ``high`` (2,), metres: its largest connected part."""
    points = _samples(vertices, faces, low, high)
    cells = np.ceil((high - low) / CELL_M).astype(int)
    cell = np.minimum(((points[:, :2] - low) / CELL_M).astype(int), cells - 1)
    floor, occupied = np.zeros(cells, bool), np.zeros(cells, bool)
    flat = np.abs(points[:, 2]) <= _ON_FLOOR_M
    floor[tuple(cell[flat].T)] = True
    standing = (points[:, 2] > _ON_FLOOR_M) & (points[:, 2] < _HEAD_M)
    occupied[tuple(cell[standing].T)] = True
    floor = ndimage.binary_closing(floor, iterations=2)
    free = np.pad(floor & ~occupied, 1)
    clearance = ndimage.distance_transform_edt(free)[1:-1, 1:-1] * CELL_M
    parts, count = ndimage.label(clearance > 0.25)
    if count:
        largest = 1 + int(np.argmax(ndimage.sum_labels(np.ones_like(parts), parts, range(1, count + 1))))
        clearance = np.where(parts == largest, clearance, 0.0)
    return FreeFloor(clearance, np.asarray(low, np.float64))


def _samples(vertices: np.ndarray, faces: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(P, 3): points of the surface below head height between the corners, nowhere farther apart than cells."""
    corners = vertices[faces]
    near = (corners[..., 2].min(axis=1) < _HEAD_M) & (corners[..., :2].max(axis=1) >= low).all(axis=1)
    corners = corners[near & (corners[..., :2].min(axis=1) <= high).all(axis=1)]
    found = []
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.ceil(np.minimum(longest, 40.0) / _ACROSS_M).astype(int) + 1
    size = 1 << np.ceil(np.log2(steps)).astype(int)  # few different grids
    for each in np.unique(size):
        share = (np.arange(each) + 0.5) / each
        a, b = np.meshgrid(share, share)
        inside = a + b <= 1.0 + 1.0 / each
        a, b = a[inside][:, None], b[inside][:, None]
        for one in np.array_split(corners[size == each], max(1, (size == each).sum() * len(a) // 2_000_000)):
            points = one[:, None, 0] + a * (one[:, None, 1] - one[:, None, 0]) + b * (one[:, None, 2] - one[:, None, 0])
            points = points.reshape(-1, 3)
            kept = (points[:, :2] >= low).all(axis=1) & (points[:, :2] < high).all(axis=1) & (points[:, 2] < _HEAD_M)
            found.append(points[kept])
    return np.concatenate(found) if found else np.zeros((0, 3))
