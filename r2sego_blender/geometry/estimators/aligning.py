"""Estimates of the captures' depth, brought to the registered poses and held against what is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...captures.capture import Capture
from ...captures.sensors.sensor_maps import SensorMap
from ...captures.sensors.upsampling import upsampled
from ...captures.sparse_points import SparsePoints
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.images import resize, resize_nearest
from ...core.progress import SILENT, Progress
from ..stereo.evidence import KnownDepth, seen_by_others
from .aligned_depth import AlignedDepth
from .alignment import Aligned, aligned
from .averaging import brought_together
from .contradictions import contradicted, without_contradictions
from .estimated_depth import EstimatedDepth
from .floor import floor_in

CARRIED = 0.1
"""Of a capture's pixels: where less is known by stereo and sensors, what is estimated carries it."""

_FEWEST = 30  # pixels of known depth that an estimate is aligned by
_LEAST_SINE = 0.02  # of the angle under which a sparse point was triangulated


def align_estimates(
    captures: Sequence[Capture],
    sparse: SparsePoints,
    trusted: Sequence[KnownDepth],
    estimates: Sequence[EstimatedDepth | None],
    progress: Progress = SILENT,
) -> tuple[AlignedDepth, ...]:
    """Each capture's estimate in metres at the size of its ``trusted`` depth, of stereo and sensors; 0 where there
    is none.

    What a carried capture shows of the floor counts as known: it is z = 0. One that shares too little known depth
    is brought along by what the others and their estimates show of it. What cannot be aligned is left out with a
    warning. Raises GeometryError where an estimate is of another size than its capture.
    """
    own = {
        index: _at_size_of(one, captures[index], trusted[index].camera)
        for index, one in enumerate(estimates)
        if one is not None
    }
    sure = sparse.widest_sine([view.camera.centre for view in trusted]) > _LEAST_SINE
    known = [
        _with_points(view, sparse.points[sparse.visibility[:, index] & sure]) for index, view in enumerate(trusted)
    ]
    by_floor = {}
    for index, view in enumerate(trusted):
        if index in own and is_carried(view.depth):
            floor = floor_in(own[index][0], view.camera)
            by_floor[index] = np.where(known[index] > 0.0, known[index], floor)
    found: dict[int, Aligned] = {}
    for index, one in own.items():
        reference = by_floor.get(index, known[index])
        if _shared(one[0], reference) >= _FEWEST:
            found |= _taken(index, aligned(*one, reference))
    for index in contradicted({i: _placed(one, trusted[i].camera) for i, one in found.items()}):
        if index in by_floor:  # what was taken for the floor is a table, or a sill
            del found[index]
    _bring_along(own, trusted, known, found)
    left_out = [captures[index].name for index in own if index not in found]
    for name in left_out:
        progress.message(
            f"the estimated depth of {name} is left out: nothing else that is known of it agrees with it", "warning"
        )
    placed = [_placed(found.get(index), view.camera) for index, view in enumerate(trusted)]
    kept = without_contradictions(placed, trusted)
    if found:
        progress.message(_in_words(found, placed, kept))
    return brought_together(kept)


def is_carried(known: np.ndarray) -> bool:
    """Whether so little of a capture's depth (H, W) is ``known`` that what is estimated carries it."""
    return bool((known > 0.0).mean() < CARRIED)


def _at_size_of(estimate: EstimatedDepth, capture: Capture, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Depth and sigma (H, W) of an estimate for each pixel of ``camera``."""
    seen_by = capture.camera.fitted(max(estimate.depth.shape))
    if seen_by.shape != estimate.depth.shape:
        raise GeometryError(
            f"the estimate of {capture.name} is {estimate.depth.shape[1]}x{estimate.depth.shape[0]}, not "
            f"{seen_by.width}x{seen_by.height}",
            where="estimated depth",
            cure="Record the maps again with `r2sego estimate-depth`.",
        )
    if estimate.depth.shape[0] >= camera.height:
        return resize_nearest(estimate.depth, *camera.shape), resize_nearest(estimate.sigma, *camera.shape)
    image = resize(capture.image(), camera.width, camera.height)
    return upsampled(SensorMap(estimate.depth, estimate.sigma, seen_by), image, camera)


def _with_points(view: KnownDepth, points: np.ndarray) -> np.ndarray:
    """(H, W) the trusted depth, and where it knows nothing the sparse points (n, 3) that the capture measured."""
    known = view.depth.copy()
    pixels, depth = view.camera.project(points)
    seen = view.camera.sees(pixels, depth)
    column, row = pixels[seen].astype(np.int64).T
    order = np.argsort(-depth[seen], kind="stable")  # the nearest stays
    row, column, depth = row[order], column[order], depth[seen][order]
    free = view.depth[row, column] <= 0.0
    known[row[free], column[free]] = depth[free]
    return known


def _shared(depth: np.ndarray, known: np.ndarray) -> int:
    return int(((depth > 0.0) & (known > 0.0)).sum())


def _taken(index: int, one: Aligned | None) -> dict[int, Aligned]:
    return {} if one is None else {index: one}


def _bring_along(
    own: Mapping[int, tuple[np.ndarray, np.ndarray]],
    trusted: Sequence[KnownDepth],
    known: Sequence[np.ndarray],
    found: dict[int, Aligned],
) -> None:
    """Add to ``found`` those that what the others show reaches, the one first of which they show most."""
    left = [index for index in own if index not in found]
    while left:
        shown = {}
        for index in left:
            others = [_shown_by(view, found.get(j)) for j, view in enumerate(trusted) if j != index]
            camera = trusted[index].camera
            seen = seen_by_others(camera, others, known[index])
            shown[index] = np.where(known[index] > 0.0, known[index], seen)
        best = max(left, key=lambda index: _shared(own[index][0], shown[index]))
        left.remove(best)
        if _shared(own[best][0], shown[best]) < _FEWEST:
            return
        for index, one in _taken(best, aligned(*own[best], shown[best])).items():
            doubt = np.median([np.median(other.sigma[other.sigma > 0.0]) for other in found.values()] or [0.0])
            sigma = np.where(one.sigma > 0.0, np.hypot(one.sigma, doubt), 0.0).astype(np.float32)
            found[index] = Aligned(one.depth, sigma, one.by, one.off)


def _shown_by(view: KnownDepth, estimate: Aligned | None) -> KnownDepth:
    """What a capture knows, and where it knows nothing its aligned estimate."""
    if estimate is None:
        return view
    return KnownDepth(view.camera, np.where(view.depth > 0.0, view.depth, estimate.depth))


def _placed(one: Aligned | None, camera: Camera) -> AlignedDepth:
    if one is None:
        nothing = np.zeros(camera.shape, np.float32)
        return AlignedDepth(nothing, nothing, camera)
    return AlignedDepth(one.depth, one.sigma, camera)


def _in_words(found: dict[int, Aligned], placed: Sequence[AlignedDepth], kept: Sequence[AlignedDepth]) -> str:
    offs = [one.off for one in found.values()]
    shifts = [one.by for one in found.values() if one.by.shift]
    inverse = sum(one.inverse for one in shifts)
    valid = np.mean([(one.depth > 0.0).mean() for one in kept])
    lost = sum(int((one.depth > 0.0).sum()) for one in placed) - sum(int((one.depth > 0.0).sum()) for one in kept)
    share = lost / max(1, sum(one.depth.size for one in kept))
    return (
        f"estimated depth of {len(found)} of {len(kept)} captures, brought to their poses by a scale, in "
        f"{len(shifts) - inverse} with a shift of depth and in {inverse} of inverse depth: off by {min(offs):.1%} to "
        f"{max(offs):.1%}; valid for {valid:.0%} of their pixels, contradicted for {share:.0%}"
    )
