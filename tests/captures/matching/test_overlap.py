"""Pairs of photographs: which of their matches are taken."""

from itertools import combinations

import numpy as np
import pytest

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.overlap import match_all, match_guided, near_pairs
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.progress import SILENT

CAMERA = Camera(100, 80, 90.0, 90.0, 50.0, 40.0, np.eye(4))
BESIDE = CAMERA.at(np.array([[1.0, 0, 0, 0.3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))


@pytest.fixture
def twins():
    """Twenty features a photograph, each with its like at 7 and another at 10, on one epipolar line."""
    rng = np.random.default_rng(0)
    keypoints = np.stack([np.full(20, 50.0), np.arange(20) * 4.0 + 0.5], axis=1).astype(np.float32)
    descriptors = rng.integers(40, 200, (20, 128)).astype(np.uint8)
    like, other = descriptors.copy(), descriptors.copy()
    like[:, 0] += 7
    other[:, 1] += 10
    there = Features(
        np.concatenate([keypoints - (5.0, 0.0), keypoints - (9.0, 0.0)]).astype(np.float32),
        np.concatenate([like, other]),
    )
    return [Features(keypoints, descriptors), there]


@pytest.mark.parametrize(("ratio", "found"), [(0.6, 0), (0.8, 20)])
def test_matches_are_as_clear_as_is_set(twins, ratio, found):
    settings = CaptureSettings(match_ratio=ratio, min_matches=8)
    plain = match_all(twins, settings, SILENT)
    guided = match_guided({(0, 1): np.zeros((0, 2), np.int32)}, twins, [CAMERA, BESIDE], ["a", "b"], settings, SILENT)
    expected = np.repeat(np.arange(found)[:, None], 2, axis=1).tolist()
    assert [matches.tolist() for matches in plain.values()] == ([expected] if found else [])
    assert guided[0, 1].tolist() == expected


def test_few_cameras_are_all_near():
    rng = np.random.default_rng(1)
    cameras = [CAMERA.at(look_at(rng.normal(size=3), rng.normal(size=3))) for _ in range(17)]
    for count in range(2, 18):
        assert near_pairs(cameras[:count]) == list(combinations(range(count), 2))


@pytest.mark.parametrize("unit_m", [1.0, 0.02])
def test_of_many_cameras_those_are_near_that_see_the_same(unit_m):
    """Along a line 80 look to one side and 80 to the other; the poses' unit plays no part."""
    places = np.linspace(0.0, 8.0, 80)
    cameras = [
        CAMERA.at(look_at(np.array([x, 0.0, 1.5]) / unit_m, np.array([x, way, 1.4]) / unit_m))
        for way in (1.0, -1.0)
        for x in places
    ]
    pairs = near_pairs(cameras)
    assert all(i < j and (i < 80) == (j < 80) and j - i <= 20 for i, j in pairs)
    assert {(i, i + step) for i in range(72) for step in range(2, 6)} <= set(pairs)
    assert len(pairs) < 0.15 * 160 * 159 / 2


def test_cameras_at_one_place_are_all_near():
    cameras = [CAMERA.at(look_at(np.zeros(3), np.array([np.cos(a), np.sin(a), 0.0]))) for a in range(20)]
    assert near_pairs(cameras) == list(combinations(range(20), 2))
