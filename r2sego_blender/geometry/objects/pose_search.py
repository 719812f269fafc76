"""The energy of a shape's pose, and its minimum from many starts: kernels of the alignment.

A pose is a row of twelve: the nine of scale times rotation, row by row, then the place;
world = linear @ canonical + place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numba
import numpy as np

from ...core.compiled import kernel
from ...core.threads import in_threads
from .silhouettes import BOTH, DRAWN, MASK_ONLY, SHAPE_ONLY, MaskViews, count_pixels, scratch
from .surface_distance import SurfaceGrid, surface_distance

POSE = 12
PARTS = 3
MISFIT, POINTS, OUTSIDE = range(PARTS)
"""Parts of the energy, each from 0 to 1: the mean of 1 - IoU over the masks, the observed
points' distances, and how far the shape reaches through floor and walls."""

OUTSIDE_SLACK_M, OUTSIDE_REACH_M = 0.03, 0.10
"""How far the shape may reach through a bound, as that is not known better, and where the
penalty ends."""

OTHER_WIDTH = 0.005
"""What it costs to take a mask for wider or narrower than it was drawn."""

_PARTS_A_THREAD = 4


class Problem(NamedTuple):
    """A shape at one scale of an object's evidence.

    ``views``, with ``shown`` (V,) bool where the mask is large enough for an IoU, and the
    ``mean_area_px`` of those; ``points`` (P, 3) world metres, held at ``reach_m``; ``normals``
    (B, 3) and ``offsets`` (B,): n.x >= d inside the room; ``vertices`` and ``faces`` are drawn,
    and ``surface`` is measured to, in the canonical frame. ``point_weight``: of POINTS in the sum.
    """

    views: MaskViews
    shown: np.ndarray
    mean_area_px: float
    points: np.ndarray
    reach_m: float
    normals: np.ndarray
    offsets: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    surface: SurfaceGrid
    point_weight: float = 1.0


def energies(problem: Problem, poses: np.ndarray) -> np.ndarray:
    """(K,) energies of ``poses`` (K, 12)."""
    found = np.empty(len(poses))
    parts = np.array_split(np.arange(len(poses)), _PARTS_A_THREAD * numba.get_num_threads())
    _on_all_cores(lambda part: _energies(problem, poses, part, found), parts)
    return found


def refined(problem: Problem, poses: np.ndarray, steps: np.ndarray, evaluations: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses (K, 12) after simplex searches, and their energies (K,).

    Each search begins around where the last one ended, with a row of ``steps`` (S, 7): the
    rotation vector in rad, the logarithm of the scale, the shift in shares of the size.
    """
    poses, found = poses.copy(), np.empty(len(poses))

    def refine(k: int) -> None:
        found[k] = _simplex_searches(problem, poses[k], steps, evaluations)

    _on_all_cores(refine, range(len(poses)))
    return poses, found


def _on_all_cores(work: Callable[[Any], None], items: Iterable[Any]) -> None:
    """Kernels release the interpreter; Numba's own threads take no tuples in tuples."""
    list(in_threads(work, items, threads=numba.get_num_threads()))


@kernel
def _energies(problem, poses, chosen, found):
    local, buffer = scratch(problem.views.sizes, problem.vertices.shape[0])
    counts = np.empty((problem.views.sizes.shape[0], 3, 4), np.int64)
    for k in chosen:
        found[k] = _energy(problem, poses[k], local, buffer, counts)


@kernel
def _simplex_searches(problem, pose, steps, evaluations):
    energy = np.inf
    for s in range(steps.shape[0]):
        energy = _simplex_search(problem, pose, steps[s], evaluations)
    return energy


@kernel
def _energy(problem, pose, local, buffer, counts):
    parts = energy_parts(problem, pose, local, buffer, counts)
    return parts[MISFIT] + problem.point_weight * parts[POINTS] + parts[OUTSIDE]


@kernel
def energy_parts(problem, pose, local, buffer, counts):
    """(3,) MISFIT, POINTS and OUTSIDE of one pose; ``counts`` gets the pixels of each view."""
    linear, place = pose[:9].copy().reshape(3, 3), pose[9:].copy()
    scale = np.sqrt(linear[0, 0] ** 2 + linear[0, 1] ** 2 + linear[0, 2] ** 2)
    parts = np.zeros(PARTS)
    views = problem.views
    count_pixels(views, linear, place, problem.vertices, problem.faces, local, buffer, counts)
    for v in range(counts.shape[0]):
        parts[MISFIT] += view_misfit(problem, counts, v) / counts.shape[0]
    points = problem.points
    for p in range(points.shape[0]):
        x, y, z = points[p, 0] - place[0], points[p, 1] - place[1], points[p, 2] - place[2]
        square = scale * scale
        distance = scale * surface_distance(
            problem.surface,
            (linear[0, 0] * x + linear[1, 0] * y + linear[2, 0] * z) / square,
            (linear[0, 1] * x + linear[1, 1] * y + linear[2, 1] * z) / square,
            (linear[0, 2] * x + linear[1, 2] * y + linear[2, 2] * z) / square,
        )
        parts[POINTS] += min(distance, problem.reach_m) / problem.reach_m / points.shape[0]
    for i in range(problem.vertices.shape[0]):
        v = problem.vertices[i]
        x = linear[0, 0] * v[0] + linear[0, 1] * v[1] + linear[0, 2] * v[2] + place[0]
        y = linear[1, 0] * v[0] + linear[1, 1] * v[1] + linear[1, 2] * v[2] + place[1]
        z = linear[2, 0] * v[0] + linear[2, 1] * v[1] + linear[2, 2] * v[2] + place[2]
        deepest = OUTSIDE_SLACK_M
        for b in range(problem.offsets.shape[0]):
            n = problem.normals[b]
            deepest = max(deepest, problem.offsets[b] - (n[0] * x + n[1] * y + n[2] * z))
        outside = (min(deepest, OUTSIDE_REACH_M) - OUTSIDE_SLACK_M) / (OUTSIDE_REACH_M - OUTSIDE_SLACK_M)
        parts[OUTSIDE] += outside / problem.vertices.shape[0]
    return parts


@kernel
def view_misfit(problem, counts, v):
    """1 - IoU; where the mask shows too little, what the silhouette is too much.

    The mask is taken wider or narrower where that fits clearly better.
    """
    if not problem.shown[v]:
        return min(counts[v, DRAWN, SHAPE_ONLY] / problem.mean_area_px, 1.0)
    best = 1.0
    for width in range(3):
        found = counts[v, width]
        wrong = found[MASK_ONLY] + found[SHAPE_ONLY]
        misfit = wrong / max(wrong + found[BOTH], 1) + (0.0 if width == DRAWN else OTHER_WIDTH)
        best = min(best, misfit)
    return best


@kernel
def _moved(pose, x, target):
    """``target``: the pose after the seven changes ``x``."""
    angle = np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    turn = np.eye(3)
    if angle > 1e-12:
        a, b, c = x[0] / angle, x[1] / angle, x[2] / angle
        cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
        turn = turn + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    linear = turn @ pose[:9].copy().reshape(3, 3)
    scale = np.sqrt(linear[0, 0] ** 2 + linear[0, 1] ** 2 + linear[0, 2] ** 2)
    target[:9] = np.exp(x[3]) * linear.ravel()
    for axis in range(3):
        target[9 + axis] = pose[9 + axis] + scale * x[4 + axis]


@kernel
def _simplex_search(problem, pose, steps, evaluations):
    """Nelder and Mead's search; ``pose`` becomes the best one found, its energy is returned."""
    size = steps.shape[0]
    local, buffer = scratch(problem.views.sizes, problem.vertices.shape[0])
    counts = np.empty((problem.views.sizes.shape[0], 3, 4), np.int64)
    trial_pose = np.empty(POSE)
    corners, values = np.zeros((size + 1, size)), np.empty(size + 1)
    for i in range(size + 1):
        if i > 0:
            corners[i, i - 1] = steps[i - 1]
        _moved(pose, corners[i], trial_pose)
        values[i] = _energy(problem, trial_pose, local, buffer, counts)
    used = size + 1
    while used < evaluations:
        order = np.argsort(values, kind="mergesort")
        corners, values = corners[order], values[order]
        middle = corners[:size].sum(0) / size
        # Reflection first; then expansion, or contraction towards the better of the two ends.
        x = 2.0 * middle - corners[size]
        _moved(pose, x, trial_pose)
        value = _energy(problem, trial_pose, local, buffer, counts)
        used += 1
        if values[0] <= value < values[size - 1]:
            corners[size], values[size] = x, value
            continue
        if value < values[0]:
            further = middle + (1.0 + 2.0 / size) * (middle - corners[size])
        elif value < values[size]:
            further = middle + (0.75 - 0.5 / size) * (middle - corners[size])
        else:
            further = middle - (0.75 - 0.5 / size) * (middle - corners[size])
        _moved(pose, further, trial_pose)
        other = _energy(problem, trial_pose, local, buffer, counts)
        used += 1
        if other < min(value, values[size]):
            corners[size], values[size] = further, other
        elif value < values[size]:
            corners[size], values[size] = x, value
        else:
            for i in range(1, size + 1):
                corners[i] = corners[0] + (1.0 - 1.0 / size) * (corners[i] - corners[0])
                _moved(pose, corners[i], trial_pose)
                values[i] = _energy(problem, trial_pose, local, buffer, counts)
            used += size
    best = np.argmin(values)
    _moved(pose, corners[best], trial_pose)
    pose[:] = trial_pose
    return values[best]
