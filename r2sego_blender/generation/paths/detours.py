"""Ways around the geometry proxy, where the straight line from camera to camera cuts through it.

A detour is the least-cost way through the voxels that are clear of all surfaces (a voxel
near one costs more), pulled taut and rounded. Whether a line cuts a face is always decided
on the triangles themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from skimage.graph import MCP_Geometric

from ...core.compiled import kernel, parallel_kernel, prange

CLEARANCE_M = 0.1
"""What a detour keeps from every surface, but for its ends, which may be nearer to one."""

_VOXEL_M = 0.05
_MOST_VOXELS = 1_500_000  # of a large building: its voxels are larger
_MARGIN = 1e-9  # of a face's size, by which its border counts as the face
_REACH_M = 0.3  # nearer to a surface than this, a way costs more
_NEAR_COST = 2.0
_ENTRY_M = 0.6  # an end is joined to the clear voxels no farther away than this
_ENTRIES = 24
_SPACING_M = 0.02  # of a detour's points
_ESCAPE = 0.2  # clearance an end that is near to a surface must gain, for each metre from it
_ROUNDING = 300  # sweeps, each towards the mean of the neighbours
_CHUNK = 4096  # faces a thread tests at a time


@dataclass(frozen=True)
class Way:
    """``points`` (n, 3) float64 metres from start to goal, two if it is straight; ``note`` says
    what is special about it: a detour, or a line that cuts the proxy because there is none."""

    points: np.ndarray
    note: str = ""


class ClearSpace:
    """Where a camera may move between the surfaces of one proxy."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        """``vertices`` (V, 3) metres, ``faces`` (F, 3) indices."""
        self._corners = np.ascontiguousarray(np.asarray(vertices, np.float64)[faces])

    def cuts(self, points: np.ndarray) -> bool:
        """Whether the polyline through ``points`` (n, 3) meets a face."""
        return bool(_cuts(self._corners, np.ascontiguousarray(points, np.float64)))

    def way(self, start: np.ndarray, goal: np.ndarray) -> Way:
        """The straight line where it is free, else the shortest smooth detour, if there is one."""
        straight = np.stack([start, goal]).astype(np.float64)
        if not self.cuts(straight):
            return Way(straight)
        corners = self._corners_of_detour(*straight)
        if corners is None:
            return Way(straight, "the straight line cuts the proxy, and no way around it was found")
        rounded = self._rounded(corners)
        points = corners if self.cuts(rounded) else rounded
        length_m = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        straight_m = np.linalg.norm(straight[1] - straight[0])
        return Way(points, f"a detour of {length_m:.2f} m where {straight_m:.2f} m straight cut the proxy")

    @cached_property
    def _grid(self) -> tuple[np.ndarray, float, np.ndarray, MCP_Geometric]:
        """The voxels' low corner, side, distance (x, y, z) float32 to a surface, all metres, and
        the search through them."""
        low, high = self._corners.min(axis=(0, 1)), self._corners.max(axis=(0, 1))
        voxel_m = max(_VOXEL_M, float(np.cbrt(np.prod(np.maximum(high - low, _VOXEL_M)) / _MOST_VOXELS)))
        shape = np.floor((high - low) / voxel_m).astype(np.int64) + 1
        occupied = _occupied(self._corners, low, voxel_m, shape)
        away_m = ndimage.distance_transform_edt(~occupied, sampling=voxel_m).astype(np.float32)
        near = 1.0 - np.clip(away_m / _REACH_M, 0.0, 1.0)
        clear = away_m >= self._least_m(voxel_m)
        return low, voxel_m, away_m, MCP_Geometric(np.where(clear, 1.0 + _NEAR_COST * near, -1.0))

    @staticmethod
    def _least_m(voxel_m: float) -> float:
        """Clear voxels' centres lie this far, at least, from those of voxels with a surface.

        Surfaces and places are anywhere in their voxels: the true distance may be a voxel less.
        """
        return CLEARANCE_M + voxel_m

    def _away_m(self, points: np.ndarray) -> np.ndarray:
        """(n,) float32: the voxels' distance to a surface at ``points`` (n, 3); 0 outside."""
        low, voxel_m, away_m, _ = self._grid
        index = np.floor((points - low) / voxel_m).astype(np.int64)
        inside = ((index >= 0) & (index < away_m.shape)).all(axis=1)
        index = np.where(inside[:, None], index, 0)
        return np.where(inside, away_m[tuple(index.T)], np.float32(0.0))

    def _entries(self, end: np.ndarray) -> np.ndarray:
        """(n, 3) int: clear voxels that ``end`` can be joined to by a straight line, nearest first."""
        low, voxel_m, away_m, _ = self._grid
        reach = int(np.ceil(_ENTRY_M / voxel_m))
        first = np.floor((end - low) / voxel_m).astype(np.int64)
        offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
        voxels = first + offsets
        voxels = voxels[((voxels >= 0) & (voxels < away_m.shape)).all(axis=1)]
        voxels = voxels[away_m[tuple(voxels.T)] >= self._least_m(voxel_m)]
        centres = low + (voxels + 0.5) * voxel_m
        distance = np.linalg.norm(centres - end, axis=1)
        nearest = np.argsort(distance, kind="stable")[: 4 * _ENTRIES]
        nearest = nearest[distance[nearest] <= _ENTRY_M]
        joined = [k for k in nearest if not self.cuts(np.stack([end, centres[k]]))]
        return voxels[joined[:_ENTRIES]]

    def _corners_of_detour(self, start: np.ndarray, goal: np.ndarray) -> np.ndarray | None:
        """The taut way's corners (n, 3), or None where there is no way."""
        low, voxel_m, _, search = self._grid
        entries, exits = self._entries(start), self._entries(goal)
        if not len(entries) or not len(exits):
            return None
        costs, _ = search.find_costs(entries.tolist(), exits.tolist(), find_all_ends=False)
        reached = costs[tuple(exits.T)]
        if not np.isfinite(reached).any():
            return None
        voxels = np.array(search.traceback(exits[int(np.argmin(reached))]))
        points = np.concatenate([[start], low + (voxels + 0.5) * voxel_m, [goal]])
        corners, at = [start], 0
        while at < len(points) - 1:
            # bisection would miss ways: a farther point may be in sight where a nearer one is not
            at = next(k for k in range(len(points) - 1, at, -1) if k == at + 1 or self._sees(*points[[at, k]]))
            corners.append(points[at])
        return np.array(corners)

    def _sees(self, start: np.ndarray, goal: np.ndarray) -> bool:
        """Whether the straight line cuts nothing and keeps the clearance, but for ends nearer than that."""
        line = _resampled(np.stack([start, goal]))
        away_m = self._away_m(line)
        gone_m = _ESCAPE * np.linalg.norm(line - start, axis=1)
        least_m = np.minimum(away_m[0] + gone_m, away_m[-1] + gone_m[::-1])
        least_m = np.minimum(least_m, self._least_m(self._grid[1]))
        return bool((away_m >= least_m).all()) and not self.cuts(line[[0, -1]])

    def _rounded(self, corners: np.ndarray) -> np.ndarray:
        """The way with its corners rounded as far as the clearance allows; its ends stay."""
        points = _resampled(corners)
        least_m = self._least_m(self._grid[1])
        for _ in range(_ROUNDING):
            middle = 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:]
            kept = self._away_m(middle) >= np.minimum(least_m, self._away_m(points[1:-1]))
            points[1:-1] = np.where(kept[:, None], middle, points[1:-1])
        return points


def along(points: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """(m, 3) the places at ``shares`` (m,) in [0, 1] of the length of the way ``points`` (n, 3)."""
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack([np.interp(shares * passed[-1], passed, axis) for axis in points.T], axis=1)


def _resampled(points: np.ndarray) -> np.ndarray:
    """The way with points about ``_SPACING_M`` apart, evenly; both ends are kept exactly."""
    length_m = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    count = max(3, int(np.ceil(length_m / _SPACING_M)) + 1)
    even = along(points, np.linspace(0.0, 1.0, count))
    even[0], even[-1] = points[0], points[-1]
    return even


@kernel
def _occupied(corners, low, voxel_m, shape):
    """(x, y, z) bool: the voxels with points of a surface, taken half a voxel apart at most."""
    occupied = np.zeros((shape[0], shape[1], shape[2]), np.bool_)
    for f in range(corners.shape[0]):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        longest = max(np.sqrt(((b - a) ** 2).sum()), np.sqrt(((c - a) ** 2).sum()))
        longest = max(longest, np.sqrt(((c - b) ** 2).sum()))
        parts = np.int64(np.ceil(2.0 * longest / voxel_m)) + 1
        for i in range(parts + 1):
            for j in range(parts + 1 - i):
                s, t = i / parts, j / parts
                x = np.int64((a[0] + s * (b[0] - a[0]) + t * (c[0] - a[0]) - low[0]) / voxel_m)
                y = np.int64((a[1] + s * (b[1] - a[1]) + t * (c[1] - a[1]) - low[1]) / voxel_m)
                z = np.int64((a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]) - low[2]) / voxel_m)
                occupied[min(x, shape[0] - 1), min(y, shape[1] - 1), min(z, shape[2] - 1)] = True
    return occupied


@parallel_kernel
def _cuts(corners, points):
    """Whether a polyline meets a triangle (Moeller and Trumbore 1997), borders included."""
    count = corners.shape[0]
    chunks = (count + _CHUNK - 1) // _CHUNK
    met = np.zeros(chunks, np.bool_)
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):
        low[axis], high[axis] = points[:, axis].min(), points[:, axis].max()
    for chunk in prange(chunks):
        for f in range(chunk * _CHUNK, min(count, (chunk + 1) * _CHUNK)):
            if not met[chunk] and _boxes_meet(corners[f], low, high):
                for k in range(points.shape[0] - 1):
                    if _cut_face(corners[f], points[k], points[k + 1]):
                        met[chunk] = True
                        break
    return met.any()


@kernel
def _boxes_meet(corners, low, high):
    for axis in range(3):
        a, b, c = corners[0, axis], corners[1, axis], corners[2, axis]
        if min(a, b, c) > high[axis] or max(a, b, c) < low[axis]:
            return False
    return True


@kernel
def _cut_face(corners, start, goal):
    first, second, line = corners[1] - corners[0], corners[2] - corners[0], goal - start
    px = line[1] * second[2] - line[2] * second[1]
    py = line[2] * second[0] - line[0] * second[2]
    pz = line[0] * second[1] - line[1] * second[0]
    det = first[0] * px + first[1] * py + first[2] * pz
    if det == 0.0:  # a line in the face's plane meets its neighbours instead
        return False
    away = start - corners[0]
    u = (away[0] * px + away[1] * py + away[2] * pz) / det
    qx = away[1] * first[2] - away[2] * first[1]
    qy = away[2] * first[0] - away[0] * first[2]
    qz = away[0] * first[1] - away[1] * first[0]
    v = (line[0] * qx + line[1] * qy + line[2] * qz) / det
    t = (second[0] * qx + second[1] * qy + second[2] * qz) / det
    inside = u >= -_MARGIN and v >= -_MARGIN and u + v <= 1.0 + _MARGIN
    return inside and 0.0 <= t <= 1.0
