"""Matches that one fundamental matrix explains, and tracks of them."""

from __future__ import annotations

import numpy as np

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.tracks import tracks_of, verified
from r2sego_blender.core.cameras import Camera, look_at


def _features(keypoints) -> Features:
    keypoints = np.asarray(keypoints, np.float32)
    return Features(keypoints, np.zeros((len(keypoints), 128), np.uint8))


def test_tracks_join_matches_and_drop_what_contradicts_itself():
    features = [_features(np.arange(8).reshape(4, 2) + 10 * index) for index in range(3)]
    pairs = {
        (0, 1): np.array([[0, 0], [1, 1], [2, 2]], np.int32),
        (1, 2): np.array([[0, 3], [2, 0]], np.int32),
        # 0's features 2 and 3 would be one point
        (0, 2): np.array([[3, 0]], np.int32),
    }
    tracks = tracks_of(pairs, features)
    assert tracks.shape == (2, 3, 2)
    np.testing.assert_array_equal(tracks[0], [[0, 1], [10, 11], [26, 27]])
    np.testing.assert_array_equal(tracks[1], [[2, 3], [12, 13], [np.nan, np.nan]])
    assert tracks_of({}, features).shape == (0, 3, 2)


def test_wrong_matches_fall_whatever_the_lens_and_the_poses_are(rng):
    lens = Camera(640, 480, 500.0, 500.0, 320.0, 240.0, np.eye(4))
    cameras = [lens.at(look_at((x, -3.0, 1.5), (0.2, 0.5, 1.0))) for x in (-0.5, 0.5)]
    points = rng.uniform((-1, -0.5, 0), (1, 2, 2), (300, 3))
    a, b = (camera.project(points)[0] for camera in cameras)
    wrong = np.zeros(300, bool)
    wrong[::3] = True
    b[wrong] = rng.uniform((0, 0), (640, 480), (wrong.sum(), 2))
    features = [_features(a), _features(b)]
    matches = np.stack([np.arange(300)] * 2, axis=1).astype(np.int32)
    kept = verified({(0, 1): matches}, features, 15)[0, 1][:, 0]
    assert np.isin(np.flatnonzero(~wrong), kept).mean() > 0.97
    assert wrong[kept].mean() < 0.05
    assert np.array_equal(kept, verified({(0, 1): matches}, features, 15)[0, 1][:, 0])
    assert verified({(0, 1): matches[wrong][:14]}, features, 15) == {}
