"""SIFT features and their matching against plain references."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.matching.features import Features, epipolar_errors, match, match_along_epipolar_lines, sift
from r2sego_blender.core.cameras import Camera, look_at


def _blob(height: int, width: int, x: float, y: float) -> np.ndarray:
    columns, rows = np.arange(width) + 0.5, np.arange(height) + 0.5
    bump = np.exp(-((columns[None] - x) ** 2 + (rows[:, None] - y) ** 2) / (2 * 4.0**2))
    return np.repeat(bump[..., None], 3, axis=2).astype(np.float32)


def _reference_match(desc_a, desc_b, ratio, allowed=None):
    a, b = desc_a.astype(np.float64), desc_b.astype(np.float64)
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    if allowed is not None:
        distance[~allowed] = np.inf
    pairs = []
    for i in range(len(a)):
        order = np.argsort(distance[i], kind="stable")
        first, second = distance[i, order[0]], distance[i, order[1]]
        mutual = np.isfinite(first) and distance[:, order[0]].argmin() == i
        if mutual and first < ratio * second:
            pairs.append((i, order[0]))
    return np.array(pairs, np.int32).reshape(-1, 2)


def test_a_blob_is_found_at_its_centre_in_the_half_integer_convention():
    features = sift(_blob(120, 160, 100.3, 60.7))
    assert len(features.keypoints) >= 1
    assert np.abs(features.keypoints[0] - [100.3, 60.7]).max() < 0.05
    assert features.descriptors.dtype == np.uint8
    assert features.keypoints.dtype == np.float32


def test_images_without_texture_or_size_have_no_features():
    assert len(sift(np.full((100, 100, 3), 0.5, np.float32)).keypoints) == 0
    assert sift(np.zeros((5, 200, 3), np.float32)).descriptors.shape == (0, 128)


def test_the_same_image_gives_the_same_bytes(rng):
    image = rng.random((90, 120, 3)).astype(np.float32)
    first, second = sift(image), sift(image)
    assert first.keypoints.tobytes() == second.keypoints.tobytes()
    assert first.descriptors.tobytes() == second.descriptors.tobytes()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), count_a=st.integers(1, 700), count_b=st.integers(2, 60))
def test_matching_equals_the_plain_reference(seed, count_a, count_b):
    rng = np.random.default_rng(seed)
    b = rng.integers(0, 256, (count_b, 128), dtype=np.uint8)
    source = rng.integers(0, count_b, count_a)
    noise = rng.integers(-60, 60, (count_a, 128))
    a = np.clip(b[source].astype(int) + noise, 0, 255).astype(np.uint8)
    assert np.array_equal(match(a, b, 0.8), _reference_match(a, b, 0.8))


def test_of_equal_descriptors_the_first_is_matched(rng):
    b = rng.integers(0, 256, (40, 128), dtype=np.uint8)
    a = b[rng.integers(0, 40, 1200)]  # over several blocks
    found = match(a, b, 0.8)
    assert np.array_equal(found, _reference_match(a, b, 0.8)) and len(found) == 40
    assert len(match(a, b, 0.8, mutual=False)) == 1200
    assert len(match(b, a, 0.8)) == 0  # the second nearest is as near


@pytest.mark.parametrize("count_a, count_b", [(0, 5), (5, 1), (5, 0), (0, 0)])
def test_matching_of_nothing_is_empty(count_a, count_b):
    camera = Camera(320, 240, 260.0, 265.0, 161.0, 118.0, look_at([0, -3, 1.5], [0, 0, 1]))
    a, b = (
        Features(np.zeros((count, 2), np.float32), np.zeros((count, 128), np.uint8)) for count in (count_a, count_b)
    )
    assert match(a.descriptors, b.descriptors).shape == (0, 2)
    assert match_along_epipolar_lines(a, b, camera, camera, 2.0).shape == (0, 2)


def test_reading_matches_needs_no_numba():
    program = "import sys, r2sego_blender.captures.matching.overlap; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


def test_epipolar_matching_equals_the_plain_reference(rng):
    camera_a = Camera(320, 240, 260.0, 265.0, 161.0, 118.0, look_at([0, -3, 1.5], [0, 0, 1]))
    camera_b = camera_a.at(look_at([1.2, -2.5, 1.6], [0, 0, 1]))
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (150, 3))
    b = Features(camera_b.project(points)[0].astype(np.float32), rng.integers(0, 99, (150, 128), np.uint8))
    a_pixels = camera_a.project(points)[0].astype(np.float32)
    # Repeated texture: every descriptor occurs twice, only its place tells which is meant.
    descriptors = b.descriptors.copy()
    descriptors[75:] = descriptors[:75]
    a, b = Features(a_pixels, descriptors), Features(b.keypoints, descriptors)
    allowed = np.array(
        [
            [
                epipolar_errors(a_pixels[i : i + 1], b.keypoints[j : j + 1], camera_a, camera_b)[0] <= 2.0
                for j in range(150)
            ]
            for i in range(150)
        ]
    )
    found = match_along_epipolar_lines(a, b, camera_a, camera_b, 2.0, 0.8)
    assert np.array_equal(found, _reference_match(a.descriptors, b.descriptors, 0.8, allowed))
    assert (found[:, 0] == found[:, 1]).mean() > 0.9 and len(found) > 100
    assert len(match(a.descriptors, b.descriptors, 0.8)) == 0


def test_true_projections_lie_on_their_epipolar_lines(rng):
    camera_a = Camera(640, 480, 400.0, 410.0, 300.0, 250.0, look_at([1, -3, 1.5], [0, 0, 1]))
    camera_b = camera_a.at(look_at([-1.2, -2.5, 1.6], [0, 0.3, 1]))
    points = rng.uniform([-1, -1, 0], [1, 1, 2], (50, 3))
    errors = epipolar_errors(camera_a.project(points)[0], camera_b.project(points)[0], camera_a, camera_b)
    assert errors.max() < 1e-3
