"""SIFT features and their matching, deterministic to the bit.

Descriptors are uint8, so their inner products are integers below 2**24, which float32
holds exactly: the blocked BLAS product gives the same matches for any number of threads.
Of pairs that must lie near their epipolar lines there are few: their products are made one by one.
Numba is loaded where features are matched: child processes that only read them do without.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from ...core.cameras import Camera
from ..colmap import load_pycolmap

# Indoor walls have little texture: COLMAP's default of 0.0067 keeps too few of their features.
_PEAK_THRESHOLD = 0.003
_SMALLEST_SIDE_PX = 24
# Rows compared at once: a block of 512 x 8000 float32 scores stays near the cache.
_BLOCK = 512


class Features(NamedTuple):
    """SIFT features: ``keypoints`` (n, 2) float32, ``descriptors`` (n, 128) uint8.

    Keypoints are in pixels, the first pixel's centre is (0.5, 0.5). Those beyond the descriptors
    were matched by another matcher.
    """

    keypoints: np.ndarray
    descriptors: np.ndarray


def sift(image: np.ndarray, max_features: int = 8000) -> Features:
    """The SIFT features (root-SIFT, L1) of an image, strongest scales first.

    ``image`` is (H, W, 3) float32 in [0, 1] or uint8. An image without texture, or one
    too small for SIFT, has none.
    """
    return sift_of_grey(grey_levels(image), max_features)


def grey_levels(image: np.ndarray) -> np.ndarray:
    """(H, W) uint8: what SIFT looks at of an image (H, W, 3), float32 in [0, 1] or uint8."""
    grey = cv2.cvtColor(np.ascontiguousarray(image[..., :3]), cv2.COLOR_RGB2GRAY)
    if grey.dtype != np.uint8:
        grey = (np.clip(np.nan_to_num(grey), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    return np.ascontiguousarray(grey)


def sift_of_grey(grey: np.ndarray, max_features: int) -> Features:
    """``sift`` of ``grey_levels`` (H, W)."""
    if min(grey.shape) < _SMALLEST_SIDE_PX:
        return Features(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8))
    pycolmap = load_pycolmap()
    options = pycolmap.FeatureExtractionOptions(num_threads=1)
    options.sift.peak_threshold = _PEAK_THRESHOLD
    options.sift.max_num_features = int(max_features)
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    keypoints, descriptors = extractor.extract_from_uint8_array(grey)
    places = np.asarray(pycolmap.keypoints_to_matrix(keypoints), np.float32).reshape(-1, 4)
    values = np.asarray(descriptors.data, np.uint8).reshape(-1, 128)
    return Features(np.ascontiguousarray(places[:, :2]), np.ascontiguousarray(values))


def match(desc_a: np.ndarray, desc_b: np.ndarray, ratio: float = 0.8, mutual: bool = True) -> np.ndarray:
    """Index pairs (m, 2) int32 of nearest descriptors that pass the ratio test.

    ``desc_a`` (n, 128) and ``desc_b`` (k, 128) are uint8. A pair is kept when its distance
    is below ``ratio`` times that of the second nearest in ``b`` and, with ``mutual``, when
    each is the other's nearest. Rows are in the order of ``a``.
    """
    from .nearest_descriptors import Best, compare

    if len(desc_b) < 2:
        return np.zeros((0, 2), np.int32)
    best = Best.of(len(desc_a), len(desc_b))
    a, b = desc_a.astype(np.float32), desc_b.astype(np.float32)
    squares_a, squares_b = _squares(desc_a), _squares(desc_b)
    for rows in _blocks(len(a)):
        compare(a[rows] @ b.T, squares_a, squares_b, rows.start, *best)
    return best.pairs(ratio, mutual)


def match_along_epipolar_lines(
    a: Features, b: Features, camera_a: Camera, camera_b: Camera, max_error_px: float, ratio: float = 0.8
) -> np.ndarray:
    """Like ``match``, looking only within ``max_error_px`` of the known epipolar lines.

    The poses of both cameras are known, so repeated texture elsewhere in the image does
    not spoil the ratio test. Returns (m, 2) int32.
    """
    from .nearest_descriptors import Best, compare_near

    if len(b.descriptors) < 2:
        return np.zeros((0, 2), np.int32)
    places_a, places_b = a.keypoints[: len(a.descriptors)], b.keypoints[: len(b.descriptors)]
    lines_b = epipolar_lines(places_a, camera_a, camera_b)
    lines_a = epipolar_lines(places_b, camera_b, camera_a)
    points_a, points_b = _homogeneous(places_a), _homogeneous(places_b)
    best = Best.of(len(points_a), len(points_b))
    descriptors = np.ascontiguousarray(a.descriptors), np.ascontiguousarray(b.descriptors)
    squares = _squares(a.descriptors), _squares(b.descriptors)
    for rows in _blocks(len(points_a)):
        in_b, in_a = lines_b[rows] @ points_b.T, points_a[rows] @ lines_a.T
        compare_near(in_b, in_a, np.float32(max_error_px), *descriptors, *squares, rows.start, *best)
    return best.pairs(ratio, mutual=True)


def epipolar_lines(keypoints: np.ndarray, camera: Camera, other: Camera) -> np.ndarray:
    """(n, 3) float32: the lines in ``other``'s image on which ``camera``'s keypoints lie.

    Normalised, so that a homogeneous pixel times a line is its distance in pixels.
    """
    other_from_camera = other.camera_from_world @ camera.world_from_camera
    rotation, (x, y, z) = other_from_camera[:3, :3], other_from_camera[:3, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    fundamental = np.linalg.inv(other.matrix).T @ cross @ rotation @ np.linalg.inv(camera.matrix)
    lines = _homogeneous(keypoints).astype(np.float64) @ fundamental.T
    length = np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    return (lines / np.maximum(length, 1e-30)).astype(np.float32)


def epipolar_errors(keypoints_a: np.ndarray, keypoints_b: np.ndarray, camera_a: Camera, camera_b: Camera) -> np.ndarray:
    """(m,) float32: the larger distance of matched keypoints to each other's epipolar line, px."""
    in_b = np.einsum("ij,ij->i", epipolar_lines(keypoints_a, camera_a, camera_b), _homogeneous(keypoints_b))
    in_a = np.einsum("ij,ij->i", epipolar_lines(keypoints_b, camera_b, camera_a), _homogeneous(keypoints_a))
    return np.maximum(np.abs(in_a), np.abs(in_b))


def _homogeneous(pixels: np.ndarray) -> np.ndarray:
    return np.concatenate([pixels, np.ones((len(pixels), 1), pixels.dtype)], axis=1)


def _blocks(count: int) -> Iterator[slice]:
    for start in range(0, count, _BLOCK):
        yield slice(start, min(start + _BLOCK, count))


def _squares(descriptors: np.ndarray) -> np.ndarray:
    """(n,) int32 squared lengths."""
    return np.einsum("ij,ij->i", descriptors, descriptors, dtype=np.int32)
