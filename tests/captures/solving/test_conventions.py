"""Poses of another convention are told by name, and the focal length that the matches fit is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_tracks import arc, measured

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.solving.conventions import fitting_convention, focal_factor

WIDTH_PX = 10.0
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def _matched(cameras, rng):
    """Features and matches of all pairs of what cameras measured, a tenth of them wrong."""
    _, pixels = measured(cameras, rng)
    seen = np.isfinite(pixels[..., 0])
    features = [
        Features(pixels[s, i].astype(np.float32), np.zeros((s.sum(), 128), np.uint8)) for i, s in enumerate(seen.T)
    ]
    number = np.cumsum(seen, axis=0) - 1
    pairs = {}
    for i in range(len(cameras)):
        for j in range(i):
            both = seen[:, j] & seen[:, i]
            matches = np.stack([number[both, j], number[both, i]], axis=1).astype(np.int32)
            matches[::10, 1] = rng.permutation(matches[::10, 1])
            pairs[j, i] = matches
    return pairs, features


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda pose: pose @ OPENGL, ["axes"]),
        (np.linalg.inv, ["camera_from_world"]),
        # OpenGL's camera_from_world, read as world_from_camera
        (lambda pose: OPENGL @ np.linalg.inv(pose), ["axes", "camera_from_world"]),
    ],
)
def test_the_convention_that_fits_is_named(read, words, rng):
    cameras = arc(7)
    pairs, features = _matched(cameras, rng)
    given = [camera.at(read(camera.world_from_camera)) for camera in cameras]
    found = fitting_convention(pairs, features, given, WIDTH_PX)
    assert found is not None
    assert {word for word in ("axes", "camera_from_world") if word in found} == set(words)


def test_right_poses_and_poses_of_nothing_have_none(rng):
    cameras = arc(7)
    pairs, features = _matched(cameras, rng)
    assert fitting_convention(pairs, features, cameras, WIDTH_PX) is None
    shuffled = [cameras[k] for k in (3, 5, 0, 6, 1, 4, 2)]
    assert fitting_convention(pairs, features, shuffled, WIDTH_PX) is None
    assert fitting_convention({}, features, cameras, WIDTH_PX) is None


@pytest.mark.parametrize("factor", [0.25, 0.8, 1.0, 4.0])
def test_the_focal_length_is_found_roughly(factor, rng):
    cameras = arc(7)
    pairs, features = _matched(cameras, rng)
    given = [replace(camera, fx=camera.fx * factor, fy=camera.fy * factor) for camera in cameras]
    assert focal_factor(pairs, features, given, WIDTH_PX / 2) * factor == pytest.approx(1.0, rel=0.08)
