"""Pairs of photographs: which of their matches are taken."""

import numpy as np
import pytest

from r2sego_blender.cameras import Camera
from r2sego_blender.captures.features import Features
from r2sego_blender.captures.overlap import match_all, match_guided
from r2sego_blender.progress import SILENT
from r2sego_blender.settings import CaptureSettings

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
    there = Features(np.concatenate([keypoints - (5.0, 0.0), keypoints - (9.0, 0.0)]).astype(np.float32),
                     np.concatenate([like, other]))  # fmt: skip
    return [Features(keypoints, descriptors), there]


@pytest.mark.parametrize(("ratio", "found"), [(0.6, 0), (0.8, 20)])
def test_matches_are_as_clear_as_is_set(twins, ratio, found):
    settings = CaptureSettings(match_ratio=ratio, min_matches=8)
    plain = match_all(twins, settings, SILENT)
    guided = match_guided([(0, 1)], twins, [CAMERA, BESIDE], ["a", "b"], settings, SILENT)
    expected = np.repeat(np.arange(found)[:, None], 2, axis=1).tolist()
    assert [matches.tolist() for matches in plain.values()] == ([expected] if found else [])
    assert guided[0, 1].tolist() == expected
