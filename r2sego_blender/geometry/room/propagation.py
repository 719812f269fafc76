"""Depth where nothing in the photographs speaks for a plane: that of what is known around it, or the envelope's.

Behind everything stands the room's envelope, but what a blank pixel shows is more often a cupboard's door beside
which a few points were measured. So each superpixel asks what is known of its own photograph: near, of like colour.
The plane that explains most of it goes on to there, unless it is far in the room from what it was seen by, or other
captures see through it; where little is known, the envelope is likelier.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..stereo.evidence import FREE_MARGIN, KnownDepth, collect_votes
from .patch_depth import ColourView
from .planes import RoomPlanes
from .point_evidence import PointEvidence
from .superpixels import superpixels

_PATCH_SHARE = 1 / 45  # of the picture's width
_COMPACTNESS = 12.0  # CIELAB
_KNOWN_SHARE = 0.3  # of a superpixel, for it to count as known
_SEEN_BY_OTHERS = 0.4  # how much their completed depth counts beside trusted depth: nine tenths of it are right
_REACH_SHARE = 1 / 67  # of the width, from which on what is known weighs less, with the distance's square
_LIKE_COLOURS = 12.0  # CIELAB: how much colours differ where that falls to exp(-1/2)
_ANY_COLOUR = 0.1  # how much of any other colour counts
_LITTLE_KNOWN = 0.05  # the weight of what is known at which the envelope is as likely
_ON_PLANE = 0.06  # relative depth, one sigma, from a plane on which something lies
_BOUNDS = 2.0  # times as likely as another plane is one that bounds the room
_LEVEL_REACH_M, _UPRIGHT_REACH_M = 0.5, 2.0  # a table's top ends sooner than a cupboard's front
_EXPLAINED = 0.2  # of what is known, that a plane has to explain
_SWEPT_INLIERS = 8  # a bound with no more points was found by its colours (``bounds``): it stays
_SEEN_THROUGH = 0.1  # times as likely for each capture that sees through it
_NEAREST_M = 0.3


def propagated_depth(
    view: ColourView,
    points: PointEvidence,
    seen: np.ndarray,
    planes: RoomPlanes,
    last: np.ndarray,
    others: Sequence[KnownDepth],
) -> np.ndarray:
    """(H, W) float32 planar metres at which what is known of ``view`` goes on: its trusted depth, ``points``, and
    ``seen`` (H, W), planar metres of what other captures were completed by, 0 elsewhere. 0 where nothing is known or
    there is no plane. ``last`` (H, W): nothing lies beyond; ``others`` are the trusted depth of the other captures."""
    patches = superpixels(view.colours, max(round(_PATCH_SHARE * view.camera.width), 2), _COMPACTNESS)
    rows, columns, known, trust = _known(view, points, seen, patches)
    if not len(known) or not len(planes.normals):
        return np.zeros(view.camera.shape, np.float32)
    at = _centres(patches)
    weights, sure = _weights(view, patches, at, rows, columns, trust)
    centre, rays = view.camera.centre, view.camera.rays()[at] @ view.camera.world_from_camera[:3, :3].T
    depths = planes.depths(view.camera)
    far = last[at]
    score = np.zeros((len(far), len(depths)))
    for index, depth in enumerate(depths):
        there = depth[rows, columns]
        on = np.where(there > 0.0, np.exp(-0.5 * ((known - there) / (_ON_PLANE * known)) ** 2), 0.0)
        here = weights @ on * sure
        if planes.bounding[index]:
            here = _BOUNDS * here + 1.0 - sure
            if planes.inliers[index] <= _SWEPT_INLIERS:
                here = np.maximum(here, 1.0)
        elif (on > 0.5).any():
            world = view.camera.unproject(depth)
            away = cKDTree(world[rows, columns][on > 0.5]).query(world[at])[0]
            reach_m = _LEVEL_REACH_M if abs(planes.normals[index, 2]) > 0.5 else _UPRIGHT_REACH_M
            here = here * np.exp(-0.5 * (away / reach_m) ** 2)
        else:
            continue
        here = here * _SEEN_THROUGH ** collect_votes(centre + rays * depth[at][:, None], others, FREE_MARGIN).through
        score[:, index] = np.where((depth[at] > _NEAREST_M) & (depth[at] <= far), here, 0.0)
    best = score.argmax(axis=1)
    found = np.take_along_axis(depths, best[patches][None], axis=0)[0]
    unexplained = (score.max(axis=1) < _EXPLAINED)[patches] | (found <= _NEAREST_M) | (found > last)
    around = np.exp(weights @ np.log(known))
    around[collect_votes(centre + rays * around[:, None], others, FREE_MARGIN).through > 0] = np.inf
    return np.where(unexplained, np.minimum(around[patches], last), found).astype(np.float32)


def _known(
    view: ColourView, points: PointEvidence, seen: np.ndarray, patches: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and depth (n,) of what is known, and how much it counts: each point, and of each superpixel that
    is known, or ``seen`` by others, the median."""
    rows, columns = _medians(view.known, patches)
    rows_seen, columns_seen = _medians(np.where(view.known > 0.0, 0.0, seen), patches)
    return (
        np.concatenate([points.rows, rows, rows_seen]),
        np.concatenate([points.columns, columns, columns_seen]),
        np.concatenate([points.depth, view.known[rows, columns], seen[rows_seen, columns_seen]]),
        np.repeat([1.0, _SEEN_BY_OTHERS], [len(points.rows) + len(rows), len(rows_seen)]),
    )


def _medians(depth: np.ndarray, patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the median ``depth`` (H, W) of each superpixel of which enough has any."""
    rows, columns = np.nonzero(depth > 0.0)
    order = np.lexsort((depth[rows, columns], patches[rows, columns]))
    rows, columns = rows[order], columns[order]
    chosen, first, count = np.unique(patches[rows, columns], return_index=True, return_counts=True)
    median = (first + count // 2)[count > _KNOWN_SHARE * np.bincount(patches.ravel())[chosen]]
    return rows[median], columns[median]


def _weights(
    view: ColourView,
    patches: np.ndarray,
    at: tuple[np.ndarray, np.ndarray],
    rows: np.ndarray,
    columns: np.ndarray,
    trust: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """(P, n) how much each known pixel, which counts by ``trust`` (n,), says of each superpixel, whose middle is
    ``at``, in all 1; and (P,) how sure that is, in [0, 1]."""
    count = np.bincount(patches.ravel())
    colours = np.stack([np.bincount(patches.ravel(), view.colours[..., c].ravel()) / count for c in range(3)], axis=1)
    of_known = colours[patches[rows, columns]]
    apart = ((colours[:, None] - of_known[None]) ** 2).sum(axis=2)
    row, column = at
    squared = (row[:, None] - rows[None]) ** 2 + (column[:, None] - columns[None]) ** 2
    near = 1.0 / (squared / (_REACH_SHARE * view.camera.width) ** 2 + 1.0)
    weights = (np.exp(-0.5 * apart / _LIKE_COLOURS**2) + _ANY_COLOUR) * near * trust
    total = weights.sum(axis=1)
    return weights / total[:, None], total / (total + _LITTLE_KNOWN)


def _centres(patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column (P,) of each superpixel's middle."""
    count = np.bincount(patches.ravel())
    row, column = ((np.bincount(patches.ravel(), axis.ravel()) / count) for axis in np.indices(patches.shape))
    return row.astype(np.int64), column.astype(np.int64)
