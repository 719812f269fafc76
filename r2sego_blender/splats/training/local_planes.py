"""The plane that the points around each point lie in, and how clearly they do."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..quaternions import principal_axes

_NEIGHBOURS = 16
_CHUNK = 1 << 16  # points at a time, so that memory does not grow with their number
_LINE = 1e-6
"""Points are on a line, and in no plane, where the variance across is less than this share of that along."""


def local_planes(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes (P, 3, 3) and thickness (P,) of each of ``points`` (P, 3) with its 16 nearest ones.

    The columns of the axes are a right-handed basis, the plane's normal first; its sign says
    nothing. Thickness is the neighbours' spread along the normal over that along the plane's
    narrower axis: 0 in a plane, about 0.8 in a cloud without any, 1 on a line. Of fewer than
    17 points all are taken.
    """
    tree = cKDTree(points)
    axes, thickness = np.empty((len(points), 3, 3)), np.empty(len(points))
    count = min(_NEIGHBOURS + 1, len(points))
    for first in range(0, len(points), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        _, near = tree.query(points[chunk], k=count)
        around = points[near.reshape(-1, count)]
        around = around - around.mean(axis=1, keepdims=True)
        variances, axes[chunk] = principal_axes(np.einsum("nki,nkj->nij", around, around))
        narrow = np.maximum(variances[:, 1], np.finfo(np.float64).tiny)
        ratio = np.maximum(variances[:, 0], 0.0) / narrow
        thickness[chunk] = np.sqrt(np.where(variances[:, 1] > _LINE * variances[:, 2], ratio, 1.0))
    return axes, thickness
