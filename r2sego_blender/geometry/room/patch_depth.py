"""Depth that the photographs contradict, chosen anew for whole patches of one colour.

Stereo compares windows and completion continues surfaces, so what is narrower than a window, a
table's edge or its leg, takes the depth of the rug behind it. Its colour tells: on the rug's depth
the other captures show the rug, on its own depth they show the leg. So each patch of one colour
without trusted depth is tried at all depths before its present one. It moves to the one at which
the captures that see it show its colours, and with which its neighbours of like colour agree
(stereo by segments, Zitnick and Kang, IJCV 2007; the energy is lowered by iterated conditional modes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from scipy import ndimage

from ...core.cameras import Camera
from ...core.compiled import inlined, kernel, parallel_kernel, prange
from ..stereo.evidence import FREE_MARGIN
from .superpixels import superpixels

_PATCH_PX = 7
_COMPACTNESS = 12.0  # CIELAB
_BLUR_PX = 0.7
_ASKED_SHARE = 0.5  # of a patch without trusted depth, for it to be moved
_SEEN_SHARE = 0.5  # of such a patch in another capture's picture, for that one to say something

_DEPTH_STEP = 0.02  # between the depths tried, relative
_NEAREST_SHARE = 0.5  # of the nearest trusted depth, at which they begin
_LEAST_NEARER = 0.03
_FAR_M = 1e3  # of a patch without any depth

_FULL_DIFFERENCE = 25.0  # CIELAB: a pixel of another thing
_SEEN_THROUGH = 0.5  # cost of each capture whose trusted depth lies behind
_MOVED = 0.2  # cost of moving at all: what the photographs do not tell apart stays
_NOISE_QUANTILE, _NOISES = 0.75, 1.5  # cost of known patches where they are, below which nothing is told apart
_FEWEST_KNOWN = 20  # patches that tell that
_FEWEST_VIEWS = 2  # less say nothing of a depth
_KEPT_VIEWS = 0.7  # share of the captures that see the present depth, which must see the new one
_UNSEEN = 1.0
_NEVER = 1e6

_NEIGHBOUR = 0.7  # cost of a full step in depth, for each pixel of the border between two patches
_LIKE_COLOURS = 12.0  # CIELAB: how much colours differ where that falls to exp(-1/2)
_FULL_STEP = 0.1  # relative depth
_ROUNDS = 10


@dataclass(frozen=True)
class ColourView:
    """A capture: ``image`` (H, W, 3) float32 RGB in [0, 1] and ``known`` (H, W) float32 trusted
    planar depth in metres, 0 elsewhere, both of ``camera``."""

    camera: Camera
    image: np.ndarray
    known: np.ndarray

    @cached_property
    def colours(self) -> np.ndarray:
        """(H, W, 3) float32 CIELAB, blurred as much as sampling between pixels does."""
        return cv2.cvtColor(cv2.GaussianBlur(self.image, (0, 0), _BLUR_PX), cv2.COLOR_RGB2LAB)

    @cached_property
    def grey(self) -> np.ndarray:
        """(H, W) float32 in [0, 1]."""
        return cv2.cvtColor(self.image, cv2.COLOR_RGB2GRAY)

    @cached_property
    def patches(self) -> np.ndarray:
        """(H, W) int32 patches of one colour, numbered from 0."""
        return superpixels(self.colours, _PATCH_PX, _COMPACTNESS)


def nearer_depth(view: ColourView, others: Sequence[ColourView], depth: np.ndarray) -> np.ndarray:
    """(H, W) float32 planar metres where the photographs want something nearer, 0 elsewhere.

    ``depth`` (H, W) is the view's present one, positive wherever something is to be moved.
    """
    asked = (view.known <= 0) & (depth > 0)
    patches = view.patches
    count = int(patches.max()) + 1
    area = np.bincount(patches[asked], minlength=count)
    movable = area > _ASKED_SHARE * np.bincount(patches.ravel(), minlength=count)
    if not movable.any() or len(others) < _FEWEST_VIEWS:
        return np.zeros(depth.shape, np.float32)
    asked &= movable[patches]
    present = _medians(
        np.where(view.known > 0, view.known, depth), np.where(movable[patches], asked, view.known > 0), patches
    )
    nearest_m = _NEAREST_SHARE * min(depth[asked].min(), view.known[view.known > 0].min(initial=np.inf))
    steps = int(np.log(depth[asked].max() / nearest_m) / _DEPTH_STEP) + 1
    tried = nearest_m * np.exp(_DEPTH_STEP * np.arange(steps))

    evidence = _Evidence(view.camera, view.colours[asked], view.camera.rays()[asked], patches[asked], area, others)
    staying, stays_seen = evidence.against(depth[asked], np.ones(1), np.full(count, np.inf))
    staying = np.where(stays_seen >= _FEWEST_VIEWS, staying, 0.0)
    farthest_m = present * (1 - _LEAST_NEARER)
    moving, seen = evidence.against(np.ones(asked.sum()), tried, farthest_m)
    moved = max(_MOVED, _NOISES * _noise(view, patches, others))
    unseen = seen < np.maximum(_FEWEST_VIEWS, _KEPT_VIEWS * stays_seen)
    moving += moved + np.where(unseen, _UNSEEN, 0.0)
    moving[tried[:, None] > farthest_m] = _NEVER

    costs = np.concatenate([moving, staying]) * area
    start, end, neighbour, weight = _borders(patches, view.colours)
    choice = _settled(
        costs, np.log(tried), np.log(present), movable, start, end, neighbour, weight, _FULL_STEP, _ROUNDS
    )
    nearer = asked & (choice < steps)[patches]
    return np.where(nearer, np.append(tried, 0.0)[choice][patches], 0.0).astype(np.float32)


def more_alike(
    view: ColourView, others: Sequence[ColourView], asked: np.ndarray, depth: np.ndarray, than: np.ndarray
) -> np.ndarray:
    """(H, W) bool: where the others show the view's colours more at ``depth`` than at the depth ``than``, by patches
    of the pixels ``asked`` for; all (H, W), depths in planar metres. False where none sees both."""
    if not asked.any() or not others:
        return np.zeros(asked.shape, bool)
    patches = view.patches
    area = np.bincount(patches[asked], minlength=int(patches.max()) + 1)
    evidence = _Evidence(view.camera, view.colours[asked], view.camera.rays()[asked], patches[asked], area, others)
    (cost,), (seen,) = evidence.against(depth[asked], np.ones(1), np.full(len(area), np.inf))
    (cost_than,), (seen_than,) = evidence.against(than[asked], np.ones(1), np.full(len(area), np.inf))
    return asked & ((np.minimum(seen, seen_than) > 0) & (cost < cost_than))[patches]


def _noise(view: ColourView, patches: np.ndarray, others: Sequence[ColourView]) -> float:
    """What the others' colours cost patches whose depth is known: exposures, gloss and blur differ. 0 where too few
    tell."""
    known = view.known > 0
    area = np.bincount(patches[known], minlength=int(patches.max()) + 1)
    evidence = _Evidence(view.camera, view.colours[known], view.camera.rays()[known], patches[known], area, others)
    (cost,), (seen,) = evidence.against(view.known[known], np.ones(1), np.full(len(area), np.inf))
    told = cost[(area > _ASKED_SHARE * np.bincount(patches.ravel())) & (seen >= _FEWEST_VIEWS)]
    return float(np.quantile(told, _NOISE_QUANTILE)) if len(told) >= _FEWEST_KNOWN else 0.0


@dataclass(frozen=True)
class _Evidence:
    """What the ``others`` say against depths of a camera's patches: of its M asked pixels the
    ``colours`` and ``rays`` (M, 3) and the ``patches`` (M,), and how many each patch has, ``area`` (P,)."""

    camera: Camera
    colours: np.ndarray
    rays: np.ndarray
    patches: np.ndarray
    area: np.ndarray
    others: Sequence[ColourView]

    def against(self, depth: np.ndarray, factors: np.ndarray, largest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(L, P) cost of each patch when its pixels have ``depth`` (M,) times each of
        ``factors`` (L,), 0 and up, and (L, P) how many captures see it there.

        The better half of those counts, two at least: the others may see something that stands before it.
        Factors above a patch's ``largest`` (P,) are not looked at: as if nobody saw it there.
        """
        points = self.rays * depth[:, None]
        largest = np.asarray(largest, np.float64)  # the kernel is compiled once
        compared = [
            _compared(
                self.colours,
                points,
                self.patches,
                factors,
                largest,
                other.camera.camera_from_world @ self.camera.world_from_camera,
                np.array([other.camera.fx, other.camera.fy, other.camera.cx, other.camera.cy]),
                other.colours,
                other.known,
                _FULL_DIFFERENCE,
                FREE_MARGIN,
            )
            for other in self.others
        ]
        difference, seen_px, through = (np.stack(each) for each in zip(*compared, strict=True))
        area = np.maximum(self.area, 1)
        says = seen_px > _SEEN_SHARE * area
        each = np.sort(np.where(says, difference / np.maximum(seen_px, 1), np.inf), axis=0)
        seen = says.sum(axis=0)
        half = np.maximum((seen + 1) // 2, np.clip(seen, 1, 2))
        total = np.where(np.isfinite(each), each, 0.0).cumsum(axis=0)
        cost = np.take_along_axis(total, half[None] - 1, axis=0)[0] / half
        return np.where(seen > 0, cost, 1.0) + _SEEN_THROUGH * through.sum(axis=0) / area, seen


def _medians(depth: np.ndarray, counted: np.ndarray, patches: np.ndarray) -> np.ndarray:
    """(P,) median depth of each patch over the ``counted`` pixels; far away without any."""
    found = ndimage.median(depth, np.where(counted, patches, -1), np.arange(patches.max() + 1))
    return np.where(np.isfinite(found) & (found > 0), found, _FAR_M)


def _borders(patches: np.ndarray, colours: np.ndarray) -> tuple[np.ndarray, ...]:
    """The neighbours of each patch: ``start`` and ``end`` (P,) of its entries in ``neighbour`` and
    ``weight`` (N,), pixels of their border times how alike their colours are."""
    count = int(patches.max()) + 1
    pairs = np.concatenate(
        [
            np.stack([patches[:, :-1].ravel(), patches[:, 1:].ravel()], axis=1),
            np.stack([patches[:-1].ravel(), patches[1:].ravel()], axis=1),
        ]
    ).astype(np.int64)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    keys, length = np.unique(pairs[:, 0] * count + pairs[:, 1], return_counts=True)
    patch, neighbour = keys // count, keys % count
    index = np.arange(count)
    mean = np.stack([ndimage.mean(colours[..., channel], patches, index) for channel in range(3)], axis=1)
    apart = ((mean[patch] - mean[neighbour]) ** 2).sum(axis=1)
    weight = _NEIGHBOUR * length * np.exp(-0.5 * apart / _LIKE_COLOURS**2)
    return np.searchsorted(patch, index), np.searchsorted(patch, index, side="right"), neighbour, weight


@inlined
def _between(first, second, share):
    return first * (1.0 - share) + second * share


@parallel_kernel
def _compared(
    colours, points, patches, factors, largest, pose, lens, other_colours, other_known, full_difference, free_margin
):
    """(L, P) sums over the pixels of each patch, for each factor of their ``points``: the difference
    of the colours in [0, 1], how many the other capture sees, and how often it sees through them."""
    height, width = other_known.shape
    difference = np.zeros((len(factors), len(largest)))
    seen = np.zeros((len(factors), len(largest)))
    through = np.zeros((len(factors), len(largest)))
    for row in prange(len(factors)):
        for p in range(len(patches)):
            patch = patches[p]
            if factors[row] > largest[patch]:
                continue
            x, y, z = points[p, 0] * factors[row], points[p, 1] * factors[row], points[p, 2] * factors[row]
            depth = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
            if depth <= 1e-3:
                continue
            u = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]) / depth
            v = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]) / depth
            u = lens[0] * u + lens[2] - 0.5
            v = lens[1] * v + lens[3] - 0.5
            if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
                continue
            known = other_known[int(v + 0.5), int(u + 0.5)]
            if 0.0 < known < depth * (1.0 - free_margin):
                continue  # hidden
            if known > depth * (1.0 + free_margin):
                through[row, patch] += 1.0
            left, top = int(u), int(v)
            total = 0.0
            for c in range(3):
                upper = _between(other_colours[top, left, c], other_colours[top, left + 1, c], u - left)
                lower = _between(other_colours[top + 1, left, c], other_colours[top + 1, left + 1, c], u - left)
                step = _between(upper, lower, v - top) - colours[p, c]
                total += step * step
            difference[row, patch] += min(np.sqrt(total) / full_difference, 1.0)
            seen[row, patch] += 1.0
    return difference, seen, through


@kernel
def _settled(costs, log_tried, log_present, movable, start, end, neighbour, weight, full_step, rounds):
    """(P,) which row of ``costs`` (L + 1, P) each patch chooses, the last to stay as it is."""
    stay = len(log_tried)
    choice = np.full(len(movable), stay)
    for patch in range(len(movable)):
        if movable[patch]:
            choice[patch] = np.argmin(costs[:, patch])
    for _ in range(rounds):
        changed = False
        for patch in range(len(movable)):
            if not movable[patch]:
                continue
            best, at = np.inf, choice[patch]
            for row in range(stay + 1):
                cost = costs[row, patch]
                here = log_tried[row] if row < stay else log_present[patch]
                for n in range(start[patch], end[patch]):
                    if cost >= best:
                        break
                    other = neighbour[n]
                    there = log_tried[choice[other]] if choice[other] < stay else log_present[other]
                    cost += weight[n] * min(abs(here - there) / full_step, 1.0)
                if cost < best:
                    best, at = cost, row
            if at != choice[patch]:
                choice[patch] = at
                changed = True
        if not changed:
            break
    return choice
