"""Matches brought to where two photographs agree: known warps of one texture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from r2sego_blender.captures.matching import subpixel
from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.overlap import Matched

WARPS = [
    np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    np.array([[1.05, 0.12, -4.3], [-0.08, 0.93, 6.7]]),
    np.array([[0.8, -0.25, 40.4], [0.22, 1.1, -12.6]]),
]


@pytest.fixture(scope="module")
def texture():
    rng = np.random.default_rng(5)
    grey = sum(
        cv2.resize(rng.random((240 // cell, 320 // cell), np.float32), (320, 240), interpolation=cv2.INTER_CUBIC)
        for cell in (5, 10, 20)
    )
    return np.clip(grey / 3.0 * 255.0, 0.0, 255.0)


@pytest.fixture(scope="module")
def images(texture):
    """The texture under each warp; the last is a darker photograph."""
    centred = []
    for warp in WARPS:  # OpenCV's first pixel has its centre at (0, 0)
        shift = warp[:, 2] + (warp[:, :2] - np.eye(2)) @ [0.5, 0.5]
        centred.append(cv2.warpAffine(texture, np.column_stack([warp[:, :2], shift]), (320, 240)))
    centred[2] = 0.5 * centred[2] + 20.0
    return [np.repeat(np.rint(grey)[..., None], 3, axis=2).astype(np.uint8) for grey in centred]


def _matched(off_px: float, seed: int = 1):
    """Three features of each of 200 tracks, off by a normal error, and where they are in truth."""
    rng = np.random.default_rng(seed)
    places = rng.uniform([70, 60], [240, 180], (200, 2))
    true = [places @ warp[:, :2].T + warp[:, 2] for warp in WARPS]
    features = [
        Features((one + rng.normal(0.0, off_px, one.shape)).astype(np.float32), np.zeros((0, 128), np.uint8))
        for one in true
    ]
    rows = np.column_stack([np.arange(200, dtype=np.int32)] * 2)
    return Matched(features, {(0, 1): rows, (0, 2): rows, (1, 2): rows}), true


def _errors(matched, i, j):
    """How far the second of a match is from where the warps say that the first is."""
    rows = matched.pairs[i, j]
    a, b = (matched.features[k].keypoints[rows[:, side]].astype(float) for side, k in enumerate((i, j)))
    in_texture = (a - WARPS[i][:, 2]) @ np.linalg.inv(WARPS[i][:, :2]).T
    return np.linalg.norm(in_texture @ WARPS[j][:, :2].T + WARPS[j][:, 2] - b, axis=1)


def test_matches_off_by_a_pixel_are_brought_to_a_tenth_in_all_pairs_of_a_track(images):
    matched, _ = _matched(0.7)
    aligned = subpixel.align_matches(images, matched)
    for pair in matched.pairs:
        assert np.median(_errors(matched, *pair)) > 0.7
        assert len(aligned.pairs[pair]) > 120
        assert np.quantile(_errors(aligned, *pair), 0.9) < 0.15


def test_what_shows_something_else_is_no_match_any_more(images):
    matched, _ = _matched(0.3)
    wrong = np.arange(200) % 5 == 0
    for rows in matched.pairs.values():
        rows[wrong, 1] = np.roll(rows[wrong, 1], 1)
    aligned = subpixel.align_matches(images, matched)
    for rows in aligned.pairs.values():
        kept = np.isin(np.flatnonzero(wrong), rows[:, 0])
        assert kept.mean() < 0.1 and len(rows) > 100


def test_where_nothing_can_be_aligned_the_matches_stay(images):
    flat = [np.full_like(image, 120) for image in images]
    matched, _ = _matched(0.7)
    aligned = subpixel.align_matches(flat, matched)
    for k in range(3):
        assert np.array_equal(aligned.features[k].keypoints, matched.features[k].keypoints)
    for pair, rows in matched.pairs.items():
        assert np.array_equal(aligned.pairs[pair], rows)


def test_one_feature_of_each_track_stays(images):
    matched, _ = _matched(0.7)
    aligned = subpixel.align_matches(images, matched)
    moved = [(aligned.features[k].keypoints != matched.features[k].keypoints).any(axis=1) for k in range(3)]
    assert (sum(moved) <= 2).all() and np.mean(sum(moved)) > 1.5


def test_inverses_are_numpys(rng):
    matrices = rng.normal(size=(50, 6, 6))
    matrices = matrices @ matrices.transpose(0, 2, 1) + 0.1 * np.eye(6)
    assert np.allclose(subpixel._inverse(matrices), np.linalg.inv(matrices), rtol=1e-6, atol=1e-6)
