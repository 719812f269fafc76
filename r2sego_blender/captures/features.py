"""SIFT features and their matching, deterministic to the bit.

Descriptors are uint8, so their inner products are integers below 2**24, which float32
holds exactly: the blocked BLAS product gives the same matches for any number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from ..cameras import Camera
from .colmap import load_pycolmap

# Indoor walls have little texture: COLMAP's default of 0.0067 keeps too few of their features.
_PEAK_THRESHOLD = 0.003
_SMALLEST_SIDE_PX = 24
# Rows compared at once: a block of 512 x 8000 float32 scores stays near the cache.
_BLOCK = 512


class Features(NamedTuple):
    """SIFT features: ``keypoints`` (n, 2) float32, ``descriptors`` (n, 128) uint8.

    Keypoints are in pixels, the first pixel's centre is (0.5, 0.5).
    """

    keypoints: np.ndarray
    descriptors: np.ndarray


def sift(image: np.ndarray, max_features: int = 8000) -> Features:
    """The SIFT features (root-SIFT, L1) of an image, strongest scales first.

    ``image`` is (H, W, 3) float32 in [0, 1] or uint8. An image without texture, or one
    too small for SIFT, has none.
    """
    pycolmap = load_pycolmap()
    pixels = np.ascontiguousarray(image[..., :3])
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    if grey.dtype != np.uint8:
        grey = (np.clip(np.nan_to_num(grey), 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    if min(grey.shape) < _SMALLEST_SIDE_PX:
        return Features(np.zeros((0, 2), np.float32), np.zeros((0, 128), np.uint8))
    options = pycolmap.FeatureExtractionOptions(num_threads=1)
    options.sift.peak_threshold = _PEAK_THRESHOLD
    options.sift.max_num_features = int(max_features)
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    keypoints, descriptors = extractor.extract_from_uint8_array(np.ascontiguousarray(grey))
    places = np.asarray(pycolmap.keypoints_to_matrix(keypoints), np.float32).reshape(-1, 4)
    values = np.asarray(descriptors.data, np.uint8).reshape(-1, 128)
    return Features(np.ascontiguousarray(places[:, :2]), np.ascontiguousarray(values))


def match(desc_a: np.ndarray, desc_b: np.ndarray, ratio: float = 0.8, mutual: bool = True) -> np.ndarray:
    """Index pairs (m, 2) int32 of nearest descriptors that pass the ratio test.

    ``desc_a`` (n, 128) and ``desc_b`` (k, 128) are uint8. A pair is kept when its distance
    is below ``ratio`` times that of the second nearest in ``b`` and, with ``mutual``, when
    each is the other's nearest. Rows are in the order of ``a``.
    """
    return _best_pairs(desc_a, desc_b, ratio, mutual, lambda rows, squared: squared)


def match_along_epipolar_lines(
    a: Features, b: Features, camera_a: Camera, camera_b: Camera, max_error_px: float, ratio: float = 0.8
) -> np.ndarray:
    """Like ``match``, looking only within ``max_error_px`` of the known epipolar lines.

    The poses of both cameras are known, so repeated texture elsewhere in the image does
    not spoil the ratio test. Returns (m, 2) int32.
    """
    lines_b = epipolar_lines(a.keypoints, camera_a, camera_b)
    lines_a = epipolar_lines(b.keypoints, camera_b, camera_a)
    points_a, points_b = _homogeneous(a.keypoints), _homogeneous(b.keypoints)

    def only_near(rows: slice, squared: np.ndarray) -> np.ndarray:
        far = np.abs(lines_b[rows] @ points_b.T) > max_error_px
        far |= np.abs(points_a[rows] @ lines_a.T) > max_error_px
        squared[far] = np.inf
        return squared

    return _best_pairs(a.descriptors, b.descriptors, ratio, True, only_near)


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


def epipolar_errors(
    keypoints_a: np.ndarray, keypoints_b: np.ndarray, camera_a: Camera, camera_b: Camera
) -> np.ndarray:
    """(m,) float32: the larger distance of matched keypoints to each other's epipolar line, px."""
    in_b = np.einsum("ij,ij->i", epipolar_lines(keypoints_a, camera_a, camera_b), _homogeneous(keypoints_b))
    in_a = np.einsum("ij,ij->i", epipolar_lines(keypoints_b, camera_b, camera_a), _homogeneous(keypoints_a))
    return np.maximum(np.abs(in_a), np.abs(in_b))


def _homogeneous(pixels: np.ndarray) -> np.ndarray:
    return np.concatenate([pixels, np.ones((len(pixels), 1), pixels.dtype)], axis=1)


def _blocks(count: int) -> Iterator[slice]:
    for start in range(0, count, _BLOCK):
        yield slice(start, min(start + _BLOCK, count))


def _best_pairs(desc_a, desc_b, ratio, mutual, restrict) -> np.ndarray:
    """The pairs of ``match`` after ``restrict(rows, squared distances)`` has ruled some out."""
    count_a, count_b = len(desc_a), len(desc_b)
    if count_a == 0 or count_b < 2:
        return np.zeros((0, 2), np.int32)
    a, b = desc_a.astype(np.float32), desc_b.astype(np.float32)
    squares_b = np.einsum("ij,ij->i", b, b)
    nearest = np.zeros(count_a, np.int64)
    passes = np.zeros(count_a, bool)
    best_for_b = np.full(count_b, np.inf, np.float32)
    owner_of_b = np.full(count_b, -1, np.int64)
    for rows in _blocks(count_a):
        block = a[rows]
        squared = np.einsum("ij,ij->i", block, block)[:, None] + squares_b - 2.0 * (block @ b.T)
        squared = restrict(rows, squared)
        index = np.arange(len(block))
        best = squared.argmin(axis=1)
        first = squared[index, best]
        closest_row = squared.argmin(axis=0)
        closest = squared[closest_row, np.arange(count_b)]
        nearer = closest < best_for_b
        best_for_b[nearer] = closest[nearer]
        owner_of_b[nearer] = closest_row[nearer] + rows.start
        squared[index, best] = np.inf
        second = squared.min(axis=1)
        nearest[rows] = best
        passes[rows] = np.isfinite(first) & (first < ratio * ratio * second)
    if mutual:
        passes &= owner_of_b[nearest] == np.arange(count_a)
    kept = np.flatnonzero(passes)
    return np.stack([kept, nearest[kept]], axis=1).astype(np.int32)
