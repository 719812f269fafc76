"""Line segments of the captures, and the room's two level directions that most of them follow.

Gravity is known, so each segment that is not upright is level in one direction only, that of its plane through the
camera's centre cut level; the room's turn about the vertical is where most of these agree modulo a right angle
(Manhattan world; Coughlan and Yuille, ICCV 1999). Segments are those of LSD (von Gioi et al., TPAMI 2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from ...core.cameras import Camera

_LEAST_LENGTH = 0.04  # of the longest side
_UPRIGHT_COSINE = 0.05
_BINS = 180  # of a right angle
_SPREAD = 3.0  # bins, sigma
_WITHIN_RAD = 0.04  # of the peak, for its mean
_OFF_RAD = 0.05  # by which a segment may miss its direction
_STEP_PX = 4.0  # between samples of a segment
ALONG_X, ALONG_Y, UPRIGHT, ASTRAY = 0, 1, 2, 3


@dataclass(frozen=True)
class Segments:
    """``view`` (n,) int64; ``ends`` (n, 2, 3) float64, unit rays in the world through both ends; ``length`` (n,), as a
    share of the picture's longest side."""

    view: np.ndarray
    ends: np.ndarray
    length: np.ndarray

    @property
    def planes(self) -> np.ndarray:
        """(n, 3) unit normals of the planes through the camera's centre and the segment."""
        normal = np.cross(self.ends[:, 0], self.ends[:, 1])
        return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def find_segments(images: Sequence[np.ndarray], cameras: Sequence[Camera]) -> Segments:
    """Those of pictures (H, W, 3) float32 in [0, 1], as their cameras see them."""
    views, ends, lengths = [], [], []
    detector = cv2.createLineSegmentDetector()
    for index, (image, camera) in enumerate(zip(images, cameras, strict=True)):
        grey = cv2.cvtColor((np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8), cv2.COLOR_RGB2GRAY)
        found = detector.detect(grey)[0]
        found = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64) + 0.5
        length = np.linalg.norm(found[:, 1] - found[:, 0], axis=1) / max(camera.shape)
        found, length = found[length > _LEAST_LENGTH], length[length > _LEAST_LENGTH]
        local = np.ones((len(found), 2, 3))
        local[..., :2] = (found - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        rays = local @ camera.world_from_camera[:3, :3].T
        ends.append(rays / np.linalg.norm(rays, axis=2, keepdims=True))
        views.append(np.full(len(found), index))
        lengths.append(length)
    return Segments(np.concatenate(views), np.concatenate(ends), np.concatenate(lengths))


def level_turn(segments: Segments) -> tuple[float, float]:
    """The room's turn about z, rad in [0, pi / 2), and the share of the segments' length that follows it.

    Both directions have to be followed: furniture that stands aslant, a carpet's stripes, have mostly one.
    """
    normal = segments.planes
    weight = segments.length * np.hypot(normal[:, 0], normal[:, 1]) * (np.abs(normal[:, 2]) > _UPRIGHT_COSINE)
    angle = np.mod(np.arctan2(-normal[:, 0], normal[:, 1]), np.pi)
    if weight.sum() <= 0.0:
        return 0.0, 0.0
    counts = np.bincount((angle / np.pi * 2 * _BINS).astype(int) % (2 * _BINS), weight, minlength=2 * _BINS)
    smooth = ndimage.gaussian_filter1d(counts, _SPREAD, mode="wrap")
    peak = (int(np.sqrt(smooth[:_BINS] * smooth[_BINS:]).argmax()) + 0.5) / _BINS * np.pi / 2
    for _ in range(3):
        off = np.mod(angle - peak + np.pi / 4, np.pi / 2) - np.pi / 4
        close = weight * (np.abs(off) < _WITHIN_RAD)
        peak += float((off * close).sum() / max(close.sum(), 1e-12))
    return float(np.mod(peak, np.pi / 2)), float(close.sum() / weight.sum())


def directions(segments: Segments, turn: float) -> np.ndarray:
    """(n,) int64: which of the room's axes each segment follows, ``ASTRAY`` if none."""
    axes = room_axes(turn)
    middle = segments.ends.sum(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    towards = np.cross(middle[:, None], axes[None])  # the plane through the middle that holds the axis
    length = np.linalg.norm(towards, axis=2)
    # Seen along an axis, everything follows it.
    off = np.arccos(np.clip(np.abs(np.einsum("nk,nak->na", segments.planes, towards)) / np.maximum(length, 1e-9), 0, 1))
    off = np.where(length > 0.1, off, np.inf)
    best = off.argmin(1)
    return np.where(off.min(1) < _OFF_RAD, best, ASTRAY)


def room_axes(turn: float) -> np.ndarray:
    """(3, 3) float64: rows are the room's axes in the world."""
    cos, sin = np.cos(turn), np.sin(turn)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def samples(segments: Segments, focal: float) -> tuple[np.ndarray, np.ndarray]:
    """Rays (m, 3) of points along the segments, a few pixels apart, and which segment each is of (m,)."""
    counts = np.maximum(2, (segments.length * focal / _STEP_PX).astype(int))
    owner = np.repeat(np.arange(len(counts)), counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(owner)) - first + 0.5) / counts[owner]
    rays = segments.ends[owner, 0] * (1.0 - share[:, None]) + segments.ends[owner, 1] * share[:, None]
    return rays / np.linalg.norm(rays, axis=1, keepdims=True), owner
