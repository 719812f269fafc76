"""Which places matches tell: a loop of pairs does, and a chain only where three photographs see the same things."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.overlap import Matched
from r2sego_blender.captures.solving.place_certainty import place_deviations
from r2sego_blender.core.cameras import Camera, look_at

LENS = Camera(400, 300, 300.0, 300.0, 200.0, 150.0, np.eye(4))
RING = [LENS.at(look_at((2 * np.cos(a), 2 * np.sin(a), 1.5), (0, 0, 1))) for a in np.linspace(0.0, 5.0, 6)]


@pytest.fixture
def told():
    """Deviations of cameras whose matches, without noise, are those of ``groups``: who sees how many points."""

    def ask(groups, unit=1.0):
        rng = np.random.default_rng(0)
        cameras = [camera.at(_in_unit(camera.world_from_camera, unit)) for camera in RING]
        keypoints = [np.zeros((0, 2)) for _ in cameras]
        pairs = {}
        for seen_by, count in groups:
            points = unit * rng.uniform((-0.4, -0.4, 0.6), (0.4, 0.4, 1.4), (count, 3))
            first = {i: len(keypoints[i]) for i in seen_by}
            for i in seen_by:
                keypoints[i] = np.concatenate([keypoints[i], cameras[i].project(points)[0]])
            for k, i in enumerate(seen_by):
                for j in seen_by[k + 1 :]:
                    rows = np.stack([first[i] + np.arange(count), first[j] + np.arange(count)], axis=1)
                    pairs[i, j] = np.concatenate([pairs.get((i, j), rows[:0]), rows]).astype(np.int32)
        features = [Features(one.astype(np.float32), np.zeros((len(one), 128), np.uint8)) for one in keypoints]
        views = {i: (camera, features[i].keypoints) for i, camera in enumerate(cameras)}
        return place_deviations(views, Matched(features, pairs), 1.0)

    return ask


def test_photographs_that_all_see_the_same_are_told(told):
    assert max(told([((0, 1, 2, 3, 4, 5), 40)]).values()) < 0.05


def test_a_loop_of_pairs_tells_all_and_a_chain_of_them_no_length(told):
    ends = [(i, i + 1) for i in range(5)]
    assert min(told([(pair, 40) for pair in ends]).values()) > 100.0
    crossed = [*ends, (0, 2), (1, 3), (2, 4), (3, 5)]
    assert max(told([(pair, 40) for pair in crossed]).values()) < 0.1


def test_what_three_see_tells_lengths_along_a_chain(told):
    chain = [((i, i + 1, i + 2), 40) for i in range(4)]
    assert max(told(chain).values()) < 0.1
    broken = told([((0, 1, 2), 40), ((3, 4, 5), 40), ((2, 3), 40)])
    assert min(broken.values()) > 100.0


def test_one_that_hangs_on_a_single_pair_is_not_told_and_one_that_shares_nothing_neither(told):
    hanging = told([((0, 1, 2, 3, 4), 40), ((4, 5), 40)])
    assert max(hanging, key=hanging.get) == 5 and hanging[5] > 100.0
    apart = told([((0, 1, 2, 3, 4), 40)])
    assert max(apart, key=apart.get) == 5 and apart[5] > 100.0


def test_the_unit_of_the_world_is_nothing(told):
    groups = [((i, i + 1, i + 2), 40) for i in range(4)]
    np.testing.assert_allclose(list(told(groups, unit=7.0).values()), list(told(groups).values()), rtol=1e-3)


def _in_unit(pose, unit):
    return np.block([[pose[:3, :3], unit * pose[:3, 3:]], [np.zeros((1, 3)), np.ones((1, 1))]])
