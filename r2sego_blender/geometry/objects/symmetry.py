"""Mirror symmetry of an object, found in what the captures saw of it.

Furniture stands upright and is often its own mirror image. A vertical plane is tried by
mirroring the observed points: where a capture sees the mirrored point's place, a surface has
to be there; where it saw free space, or its mask ends, none may be. What no capture sees says
nothing. Points that hardly move say nothing either: a flat front is its own image in the
plane it lies in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from ...core.cameras import Camera
from ..visibility.point_visibility import looked_up

_HEADINGS, _SHIFTS = 36, 25  # of the planes tried first
_FARTHEST_SHIFT = 0.3  # of the size, from the middle of the points
_ASKED, _ASKED_LAST = 350, 1500  # points mirrored in the search, and at its end
_REFINED = 4  # planes that the search goes on with
_STEPS = (0.05, 0.015)  # its first: rad, and share of the size
_EVALUATIONS = 80
_REACH_M = 0.04  # a mirrored point this wrong is wholly wrong
_MARGIN_M = 0.05  # depth is known no better
_OUTLINE_PX = 2.0  # masks are drawn no better
_LEAST_MOVED = 0.15  # of the size
_LEAST_SEEN = 0.25  # of the points, whose images have to lie on the object seen
_UPRIGHT = 0.2  # cosine below which two planes are at right angles


@dataclass(frozen=True)
class ObjectSight:
    """What captures know of an object and its surroundings, one of each a capture.

    ``beyond_px`` (H, W): how far a pixel lies outside the mask, 0 within; ``depths`` (H, W)
    metres, 0 = unknown, of what may hide the object; ``sure`` (H, W): depth that stereo
    vouches for in all pixels around.
    """

    cameras: tuple[Camera, ...]
    beyond_px: tuple[np.ndarray, ...]
    depths: tuple[np.ndarray, ...]
    sure: tuple[np.ndarray, ...]

    @staticmethod
    def of(
        cameras: Sequence[Camera],
        masks: Sequence[np.ndarray],
        depths: Sequence[np.ndarray],
        reliable: Sequence[np.ndarray],
    ) -> ObjectSight:
        """``masks`` (H, W) bool, ``depths`` and ``reliable`` (H, W) planar metres, 0 = unknown."""
        away = [cv2.distanceTransform(1 - mask.astype(np.uint8), cv2.DIST_L2, 5) for mask in masks]
        square = np.ones((3, 3), np.uint8)
        return ObjectSight(
            tuple(cameras),
            tuple(np.maximum(pixels - _OUTLINE_PX, 0) for pixels in away),
            tuple(depths),
            tuple(cv2.erode(depth.astype(np.float32), square) for depth in reliable),
        )

    def judged(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P,) bool, where a capture sees the place of a point (P, 3); and (P,) in [0, 1], how much
        some capture speaks against a surface there."""
        seen, wrong = np.zeros(len(points), bool), np.zeros(len(points))
        for camera, beyond, depths, sures in zip(self.cameras, self.beyond_px, self.depths, self.sure, strict=True):
            inside, depth, beyond_px, known, sure = looked_up(points, camera, beyond, depths, sures)
            beyond_m = beyond_px * depth / camera.fx
            within = beyond_m == 0
            before_m = np.where(within, sure - depth - _MARGIN_M / 2, 0)
            hidden = (known > 0) & (known < depth - _MARGIN_M)
            error = np.where(hidden, 0, np.clip(np.maximum(beyond_m, before_m) / _REACH_M, 0, 1))
            wrong[inside] = np.maximum(wrong[inside], error)
            seen[inside] |= within & (np.abs(sure - depth) < _MARGIN_M)
        return seen, wrong


@dataclass(frozen=True)
class MirrorPlane:
    """The points with ``normal`` . x = ``offset``; ``normal`` (3,) is unit and level, metres.

    ``energy``, 0 to 1: the mean error of the mirrored points that captures can judge;
    ``confirmed``: the share of all points whose images moved far and lie on what was seen.
    """

    normal: np.ndarray
    offset: float
    energy: float
    confirmed: float

    def mirrored(self, points: np.ndarray) -> np.ndarray:
        """The images (P, 3) of ``points`` (P, 3)."""
        return _mirrored(points, self.normal, self.offset)

    def mirrored_camera(self, camera: Camera) -> Camera:
        """The camera that would take the mirror image of a camera's picture, left and right swapped."""
        reflection = np.eye(4)
        reflection[:3, :3] -= 2 * np.outer(self.normal, self.normal)
        reflection[:3, 3] = 2 * self.offset * self.normal
        pose = reflection @ camera.world_from_camera @ np.diag([-1.0, 1.0, 1.0, 1.0])
        return Camera(camera.width, camera.height, camera.fx, camera.fy, camera.width - camera.cx, camera.cy, pose)


def find_mirror_planes(points: np.ndarray, sight: ObjectSight, max_energy: float) -> tuple[MirrorPlane, ...]:
    """The vertical planes that the object is the mirror image of itself in: none, one, or two at
    right angles, the better one first.

    ``points`` (P, 3) were observed on it. A plane is kept at ``max_energy`` or below where
    enough of the points confirm it. Deterministic.
    """
    planes: list[MirrorPlane] = []
    if len(points) < 2:
        return ()
    while len(planes) < 2:
        plane = _best(points, sight, planes)
        if plane is None or plane.energy > max_energy or plane.confirmed < _LEAST_SEEN:
            break
        planes.append(plane)
    return tuple(planes)


def _best(points: np.ndarray, sight: ObjectSight, across: Sequence[MirrorPlane]) -> MirrorPlane | None:
    """The best plane at right angles to those of ``across``."""
    low, high = np.quantile(points, [0.02, 0.98], axis=0)
    middle, size_m = (low + high) / 2, float(np.linalg.norm(high - low))
    tree = cKDTree(points)
    asked, asked_last = (
        points[np.linspace(0, len(points) - 1, min(count, len(points))).astype(int)] for count in (_ASKED, _ASKED_LAST)
    )

    def judged(some: np.ndarray, heading: float, shift: float) -> MirrorPlane:
        normal = np.array([np.cos(heading), np.sin(heading), 0.0])
        offset = float(middle @ normal + shift * size_m)
        return MirrorPlane(normal, offset, *_energy(some, tree, sight, normal, offset, size_m))

    def cost(place: np.ndarray) -> float:
        plane = judged(asked, *place)
        return plane.energy + 2 * max(0.0, _LEAST_SEEN - plane.confirmed)

    headings = np.arange(_HEADINGS) * np.pi / _HEADINGS
    shifts = np.linspace(-_FARTHEST_SHIFT, _FARTHEST_SHIFT, _SHIFTS)
    level = np.stack([np.cos(headings), np.sin(headings), np.zeros(_HEADINGS)], 1)
    usable = np.all([np.abs(level @ plane.normal) < _UPRIGHT for plane in across], axis=0)
    headings = headings[np.broadcast_to(usable, _HEADINGS)]
    starts = [np.array([heading, shift]) for heading in headings for shift in shifts]
    costs = [cost(start) for start in starts]
    found = []
    for k in np.argsort(costs, kind="stable")[:_REFINED]:
        simplex = starts[k] + np.array([(0, 0), (_STEPS[0], 0), (0, _STEPS[1])])
        options = {"initial_simplex": simplex, "maxfev": _EVALUATIONS}
        found.append(minimize(cost, starts[k], method="Nelder-Mead", options=options))
    best = min(found, key=lambda one: one.fun, default=None)
    return None if best is None else judged(asked_last, *best.x)


def _energy(
    points: np.ndarray, tree: cKDTree, sight: ObjectSight, normal: np.ndarray, offset: float, size_m: float
) -> tuple[float, float]:
    """``energy`` and ``confirmed`` of a plane; 1 and 0 where captures can judge nothing."""
    images = _mirrored(points, normal, offset)
    images = images[np.linalg.norm(images - points, axis=1) > _LEAST_MOVED * size_m]
    seen, wrong = sight.judged(images)
    asked = seen | (wrong > 0)
    if not asked.any():
        return 1.0, 0.0
    distance = tree.query(images[seen], distance_upper_bound=_REACH_M)[0]
    wrong[seen] = np.maximum(wrong[seen], np.minimum(distance / _REACH_M, 1))
    return float(wrong[asked].mean()), float((wrong[seen] < 1).sum() / len(points))


def _mirrored(points: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    return points - 2 * (points @ normal - offset)[:, None] * normal
