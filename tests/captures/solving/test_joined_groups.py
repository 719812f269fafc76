"""Groups that share one photograph: joined where what they measured lies side by side on the same surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.overlap import Matched
from r2sego_blender.captures.solving.joined_groups import joined_by_surfaces
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad

LENS = Camera(400, 300, 300.0, 300.0, 200.0, 150.0, np.eye(4))
CAMERAS = [LENS.at(look_at((x, -2.5 + 0.2 * x, 1.4), (0.4 * x, 1.0, 0.8))) for x in (-1.0, -0.5, 0.0, 0.6, 1.1)]
FIRST, SECOND, SHARED = (0, 1, 2), (2, 3, 4), 2
COUNT = 120


def _room_points(rng, low_x_m, high_x_m, astray=0.0):
    """(COUNT, 3) on a floor and a wall, or so much nearer to the shared camera or farther than these, by a share."""
    x, along = rng.uniform(low_x_m, high_x_m, COUNT), rng.uniform(0.0, 1.0, COUNT)
    on_wall = rng.random(COUNT) < 0.5
    points = np.column_stack([x, np.where(on_wall, 1.0, along), np.where(on_wall, 1.8 * along, 0.0)])
    centre = CAMERAS[SHARED].centre
    return centre + (points - centre) * np.exp(rng.uniform(-astray, astray, (COUNT, 1)))


@pytest.fixture
def joined(rng):
    """The second group's cameras, of which another frame and scale are known, in the frame of the first."""

    def ask(points_of_first, points_of_second, across=None):
        keypoints = [np.zeros((0, 2)) for _ in CAMERAS]
        pairs = {}
        for group, points in ((FIRST, points_of_first), (SECOND, points_of_second)):
            begin = {index: len(keypoints[index]) for index in group}
            for index in group:
                seen = CAMERAS[index].project(points)[0] + rng.normal(0.0, 0.3, (COUNT, 2))
                keypoints[index] = np.concatenate([keypoints[index], seen])
            for i in group:
                for j in (j for j in group if j > i):
                    pairs[i, j] = np.stack([begin[i] + np.arange(COUNT), begin[j] + np.arange(COUNT)], axis=1)
        if across is not None:
            pairs[0, 4] = across
        features = [Features(one.astype(np.float32), np.zeros((len(one), 128), np.uint8)) for one in keypoints]
        elsewhere = 3.7 * look_at((0.3, 0.2, 0.1), (1.0, 2.0, 0.5))
        elsewhere[3] = (0.0, 0.0, 0.0, 1.0)
        views = {index: (CAMERAS[index], features[index].keypoints) for index in FIRST}
        group = {index: (CAMERAS[index].transformed(elsewhere), features[index].keypoints) for index in SECOND}
        return joined_by_surfaces(views, group, Matched(features, pairs), 2.0)

    return ask


def test_points_side_by_side_on_the_same_surfaces_tell_the_scale(rng, joined):
    """They are other points, so no structure from motion could tell it."""
    found = joined(_room_points(rng, -1.2, 0.5), _room_points(rng, -0.3, 1.5))
    assert found.keys() == set(SECOND)
    spread = np.linalg.norm(CAMERAS[4].centre - CAMERAS[SHARED].centre)
    for index, camera in found.items():
        assert np.linalg.norm(camera.centre - CAMERAS[index].centre) < 0.05 * spread
        off_rad = rotation_angle_rad(camera.world_from_camera, CAMERAS[index].world_from_camera)
        assert np.degrees(off_rad) < 0.1


def test_what_lies_apart_in_the_picture_tells_nothing(rng, joined):
    assert joined(_room_points(rng, -1.5, -0.4), _room_points(rng, 0.4, 1.5)) == {}


def test_distances_that_do_not_agree_tell_nothing(rng, joined):
    assert joined(_room_points(rng, -1.2, 0.5), _room_points(rng, -0.3, 1.5, astray=0.7)) == {}


@pytest.mark.parametrize("right", [True, False])
def test_matches_between_the_groups_have_to_agree(rng, joined, right):
    seen_by_both, others = _room_points(rng, -0.3, 0.5), _room_points(rng, -0.3, 1.5)
    points = np.concatenate([seen_by_both[: COUNT // 2], others[: COUNT // 2]])
    same = np.arange(COUNT // 2)
    across = np.stack([same, same if right else same[::-1]], axis=1)
    found = joined(np.concatenate([points[: COUNT // 2], _room_points(rng, -1.2, 0.5)[: COUNT // 2]]), points, across)
    assert found.keys() == (set(SECOND) if right else set())


def test_groups_without_a_photograph_in_common_are_not_joined():
    camera, none = CAMERAS[0], np.zeros((0, 2), np.float32)
    features = [Features(none, np.zeros((0, 128), np.uint8))] * 2
    assert joined_by_surfaces({0: (camera, none)}, {1: (camera, none)}, Matched(features, {}), 2.0) == {}
