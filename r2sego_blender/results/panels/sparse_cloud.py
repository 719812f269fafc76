"""The sparse points that the overlay draws, read when a bundle is opened. No bpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.colours import linear_from_srgb
from .bundle import Bundle

_LINEAR = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class SparseCloud:
    """Points (P, 3) float32, metres, and their linear colours (P, 4) float32 in [0, 1].

    Their order is shuffled, so that the first ones are a sample of all.
    """

    points: np.ndarray
    colours: np.ndarray


_read: dict[str, tuple[int, SparseCloud]] = {}


def read_cloud(bundle: Bundle) -> SparseCloud | None:
    """The cloud of a bundle, read again when its file has changed; None without one.

    Raises SceneError when the file is damaged.
    """
    key, file = str(bundle.path), bundle.sparse_file
    if not file.is_file():
        _read.pop(key, None)
        return None
    changed = file.stat().st_mtime_ns
    if key not in _read or _read[key][0] != changed:
        points, colours = bundle.sparse_points()
        shuffled = np.random.default_rng(0).permutation(len(points))
        points, colours = points[shuffled], colours[shuffled]
        rgba = np.ones((len(points), 4), np.float32)
        rgba[:, :3] = _LINEAR[colours]
        _read[key] = changed, SparseCloud(np.ascontiguousarray(points), rgba)
    return _read[key][1]


def cloud_at(path: str) -> SparseCloud | None:
    """The cloud that ``read_cloud`` read for the bundle at ``path``; reads nothing."""
    _, cloud = _read.get(path, (0, None))
    return cloud


def forget_clouds() -> None:
    """Let the clouds go."""
    _read.clear()
