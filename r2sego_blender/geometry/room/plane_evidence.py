"""How much speaks against a plane of the room at each pixel of a capture.

Three kinds of evidence: how alike the captures look when warped by the plane's homography, how well the plane agrees
with reliable depth nearby, and whether it stays clear of space the others saw to be free. Costs are aggregated along
the image's edges by a guided filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ...core.cameras import Camera
from ..estimators.aligned_depth import AlignedDepth, certainty_of
from ..stereo.evidence import FREE_MARGIN
from .patch_depth import ColourView
from .point_evidence import PointEvidence

_NCC_RADIUS_PX = 3
_GUIDE_RADIUS_PX = 9
_GUIDE_EPSILON = 1e-3
_PHOTO_WEIGHT = 0.5  # of the photometric cost, in [0, 1]
_AGREEMENT_WEIGHT = 0.8  # of the disagreement with reliable depth, in [0, 1]
_NO_EVIDENCE = 0.6  # the disagreement assumed where there is no reliable depth
_AGREEMENT_SCALE = 0.03  # relative depth difference of full disagreement
_CONTRADICTION = 0.5  # cost of each capture that saw through the plane


@dataclass(frozen=True)
class PlaneEvidence:
    """What can speak for planes at the pixels of a ``view``: the ``others`` that see the same; ``anchor`` (H, W),
    reliable planar depth in metres, 0 where there is none; and there the ``points`` around a pixel and the
    ``estimate`` of its depth, if any, by their certainty."""

    view: ColourView
    others: Sequence[ColourView]
    anchor: np.ndarray
    points: PointEvidence
    estimate: AlignedDepth | None

    def against(self, depth: np.ndarray, row: np.ndarray) -> np.ndarray:
        """(H, W) float32 evidence against the plane that lies at ``depth`` (H, W) and whose inverse depth is ``row``
        (3,) . ray: 0 (certain) and up."""
        camera, grey_here = self.view.camera, self.view.grey
        width, height = camera.width, camera.height
        first = np.full((height, width), np.inf, np.float32)
        second = first.copy()
        contradictions = np.zeros((height, width), np.float32)
        mean, variance = self._own_moments
        outside = cv2.BORDER_CONSTANT
        linear = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        exact = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        for other, slope, shift in self._others:
            through = homography(camera, other.camera, row)
            grey = cv2.warpPerspective(
                other.grey, through, (width, height), flags=linear, borderMode=outside, borderValue=(-1,)
            )
            known = cv2.warpPerspective(
                other.known, through, (width, height), flags=exact, borderMode=outside, borderValue=(0,)
            )
            reached = depth * slope + shift
            there = (grey >= 0) & (reached > 0)
            occluded = (known > 0) & (known < reached * (1 - FREE_MARGIN))
            contradictions += there & (known > reached * (1 + FREE_MARGIN))
            cost = 1 - _correlation(grey_here, mean, variance, np.maximum(grey, 0))
            cost = np.where(there & ~occluded, np.clip(cost, 0, 1), np.float32(np.inf))
            second = np.minimum(second, np.maximum(first, cost))
            first = np.minimum(first, cost)
        # One view alone counts a quarter more than it says, none as much as the worst match.
        photo = np.where(np.isfinite(second), (first + second) / 2, np.minimum(first + 0.25, 1))
        apart = np.abs(self.anchor - depth) / np.maximum(self.anchor, 1e-6) / _AGREEMENT_SCALE
        differing, sure = self.points.against(depth, _AGREEMENT_SCALE)
        agreement = np.where(self.anchor > 0, np.minimum(apart, 1), _NO_EVIDENCE + sure * (differing - _NO_EVIDENCE))
        if self.estimate is not None:
            off = np.abs(self.estimate.depth - depth) / np.maximum(self.estimate.depth, 1e-6)
            off /= np.maximum(_AGREEMENT_SCALE, 2.0 * self.estimate.sigma)
            told = _NO_EVIDENCE + certainty_of(self.estimate.sigma) * (np.minimum(off, 1) - _NO_EVIDENCE)
            agreement = np.where((self.anchor <= 0) & (self.estimate.depth > 0), told, agreement)
        cost = _PHOTO_WEIGHT * photo + _AGREEMENT_WEIGHT * agreement + _CONTRADICTION * contradictions
        return cost.astype(np.float32)

    @cached_property
    def _own_moments(self) -> tuple[np.ndarray, np.ndarray]:
        return _moments(self.view.grey)

    @cached_property
    def _others(self) -> list[tuple[ColourView, np.ndarray, np.float32]]:
        return [(other, *_depth_in(self.view.camera, other.camera)) for other in self.others]


def homography(camera: Camera, other: Camera, row: np.ndarray) -> np.ndarray:
    """(3, 3) from pixel indices of ``camera`` to those of ``other`` through the plane whose
    inverse depth is ``row`` . ray; OpenCV's pixel centres lie at integers."""
    relative = other.camera_from_world @ camera.world_from_camera
    through = relative[:3, :3] + np.outer(relative[:3, 3], row)
    shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    return np.linalg.inv(shift) @ other.matrix @ through @ np.linalg.inv(camera.matrix) @ shift


def _depth_in(camera: Camera, other: Camera) -> tuple[np.ndarray, np.float32]:
    """(H, W) float32 a and b: what lies at depth z in ``camera`` has depth a z + b in ``other``."""
    relative = other.camera_from_world @ camera.world_from_camera
    return (camera.rays() @ relative[2, :3]).astype(np.float32), np.float32(relative[2, 3])


def _box(image: np.ndarray, radius: int) -> np.ndarray:
    side = 2 * radius + 1
    return cv2.boxFilter(image, -1, (side, side), borderType=cv2.BORDER_REFLECT)


def _moments(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = _box(image, _NCC_RADIUS_PX)
    return mean, np.maximum(_box(image * image, _NCC_RADIUS_PX) - mean * mean, 0)


def _correlation(image: np.ndarray, mean: np.ndarray, variance: np.ndarray, other: np.ndarray) -> np.ndarray:
    other_mean, other_variance = _moments(other)
    covariance = _box(image * other, _NCC_RADIUS_PX) - mean * other_mean
    noise = 4e-6  # grey-level variance of quantisation: bare patches correlate with nothing
    return covariance / np.sqrt((variance + noise) * (other_variance + noise))


def guided_filter(guide: np.ndarray, image: np.ndarray) -> np.ndarray:
    """The guided filter (He et al., 2010) of ``image`` along the edges of ``guide``."""
    mean_guide, mean = _box(guide, _GUIDE_RADIUS_PX), _box(image, _GUIDE_RADIUS_PX)
    covariance = _box(guide * image, _GUIDE_RADIUS_PX) - mean_guide * mean
    variance = _box(guide * guide, _GUIDE_RADIUS_PX) - mean_guide * mean_guide
    slope = covariance / (variance + _GUIDE_EPSILON)
    return _box(slope, _GUIDE_RADIUS_PX) * guide + _box(mean - slope * mean_guide, _GUIDE_RADIUS_PX)
