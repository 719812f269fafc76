"""COLMAP's mapping of exact matches: which photographs register, through which lens, and whom the matches believe."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.captures.matching.features import Features
from r2sego_blender.captures.matching.overlap import Matched, save_matches
from r2sego_blender.captures.solving.mapping import agreements, map_in_child
from r2sego_blender.core.cameras import Camera, look_at, rotation_angle_rad
from r2sego_blender.workers.child import call_in_child

LENS = Camera(400, 300, 300.0, 300.0, 200.0, 150.0, np.eye(4))
ARC = [(-0.9, -2.3, 1.5), (-0.3, -2.4, 1.55), (0.3, -2.3, 1.5), (0.9, -2.2, 1.45), (1.4, -1.9, 1.6)]


def _seen(rng, cameras, count):
    """Points (count, 3) that all cameras see, anywhere before them."""
    points = np.zeros((0, 3))
    while len(points) < count:
        more = rng.uniform((-3, -1, 0), (3, 3, 3), (4000, 3))
        for camera in cameras:
            pixels, depth = camera.project(more)
            inside = (depth > 0.3) & (pixels > 4).all(axis=1) & (pixels < np.array([396, 296])).all(axis=1)
            more = more[inside]
        points = np.concatenate([points, more])
    return points[:count]


def _matched(rng, cameras, groups, noise_px=0.2):
    """Exact matches, but for noise, of ``groups``: which cameras see how many points, which no other sees."""
    keypoints = [[] for _ in cameras]
    pairs = {}
    for indices, count in groups:
        points = _seen(rng, [cameras[i] for i in indices], count)
        rows = {}
        for i in indices:
            begin = sum(map(len, keypoints[i]))
            rows[i] = np.arange(begin, begin + count)
            keypoints[i].append(cameras[i].project(points)[0] + rng.normal(0, noise_px, (count, 2)))
        for k, i in enumerate(indices):
            for j in indices[k + 1 :]:
                pairs.setdefault((i, j), []).append(np.stack([rows[i], rows[j]], axis=1))
    features = [
        Features(np.concatenate(one).astype(np.float32), np.zeros((sum(map(len, one)), 128), np.uint8))
        for one in keypoints
    ]
    return Matched(features, {pair: np.concatenate(rows).astype(np.int32) for pair, rows in pairs.items()})


@pytest.fixture
def mapped(tmp_path, blank_photograph):
    paths = [str(blank_photograph(tmp_path / f"{index}.png", 40, 30)) for index in range(6)]

    def ask(matched, lens_from=None, globally=False, compare=False):
        save_matches(tmp_path / "matches.npz", *matched)
        count = len(matched.features)
        request = {
            "paths": paths[:count],
            "sizes": [(400, 300)] * count,
            "min_matches": 15,
            "lens_from": lens_from,
            "globally": globally,
            "compare": compare,
        }
        folder = tmp_path / f"ask{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        (tmp_path / "matches.npz").rename(folder / "matches.npz")
        return call_in_child(map_in_child, request | {"folder": str(folder)}, timeout_s=300.0)

    return ask


def _cameras(sixth=((1.5, -1.3, 1.5), (-1.5, 2.0, 1.0))):
    return [LENS.at(look_at(place, (0.1, 0.6, 0.55))) for place in ARC] + [LENS.at(look_at(*sixth))]


def _distance(images, i, j):
    return np.linalg.norm(_relative(images, i, j)[:3, 3])


def _relative(images, i, j):
    poses = {one["index"]: np.vstack([one["camera_from_world"], [0, 0, 0, 1]]) for one in images}
    return poses[i] @ np.linalg.inv(poses[j])


def test_through_a_lens_that_is_known_ten_points_place_a_photograph(rng, mapped):
    """It shares all else with its neighbour alone, and without a third photograph COLMAP leaves it out."""
    cameras = _cameras()
    matched = _matched(rng, cameras, [((0, 1, 2, 3, 4), 250), ((3, 4, 5), 10), ((4, 5), 120)])
    alone = mapped(matched)["models"]
    assert [one["index"] for one in alone[0]] == [0, 1, 2, 3, 4]
    assert alone[0][0]["camera"]["focal"][0] == pytest.approx(300.0, rel=0.01)
    held = mapped(matched, lens_from=alone[0])["models"][0]
    assert [one["index"] for one in held] == [0, 1, 2, 3, 4, 5]
    assert {one["camera"]["focal"][0] for one in held} == {alone[0][0]["camera"]["focal"][0]}
    found, true = _relative(held, 5, 3), cameras[5].camera_from_world @ cameras[3].world_from_camera
    assert np.degrees(rotation_angle_rad(found, true)) < 0.5
    unit = np.linalg.norm((cameras[0].camera_from_world @ cameras[4].world_from_camera)[:3, 3])
    unit /= np.linalg.norm(_relative(held, 0, 4)[:3, 3])
    assert np.linalg.norm(found[:3, 3] * unit - true[:3, 3]) < 0.03 * np.linalg.norm(true[:3, 3])


def test_groups_that_no_point_of_three_photographs_joins_are_joined_by_a_loop_of_pairs(rng, mapped):
    """One pair tells a direction and no length between groups; two tell both, and global mapping places all."""
    cameras = _cameras()
    groups = [((0, 1, 2), 250), ((3, 4, 5), 250), ((2, 3), 150)]
    loop = _matched(rng, cameras, [*groups, ((0, 5), 150)])
    alone = mapped(loop)["models"]
    assert sorted(len(model) for model in alone) == [3, 3]
    (joined,) = mapped(loop, lens_from=alone[0], globally=True)["models"]
    assert [one["index"] for one in joined] == [0, 1, 2, 3, 4, 5]
    scale = _distance(joined, 0, 2) / np.linalg.norm(cameras[0].centre - cameras[2].centre)
    for i, j in ((0, 5), (2, 3), (3, 5), (1, 4)):
        true = cameras[i].camera_from_world @ cameras[j].world_from_camera
        assert np.degrees(rotation_angle_rad(_relative(joined, i, j), true)) < 0.5
        assert _distance(joined, i, j) == pytest.approx(scale * np.linalg.norm(true[:3, 3]), rel=0.05)
    open_chain = mapped(_matched(rng, cameras, groups), lens_from=alone[0], globally=True)["models"]
    assert all(len(model) <= 3 for model in open_chain)


def test_cameras_that_turn_determine_the_lens_and_those_that_only_move_do_not(rng, mapped):
    """Of a pure translation the fundamental matrix is the same for every focal length."""
    turning = _matched(rng, _cameras()[:5], [((0, 1, 2, 3, 4), 250)])
    assert mapped(turning, compare=True)["determined"]
    straight = [LENS.at(look_at((x, -2.3, 1.5), (x, -1.3, 1.4))) for x in (-0.3, -0.1, 0.1, 0.3)]
    moving = _matched(rng, straight, [((0, 1, 2, 3), 100)])
    assert not mapped(moving, compare=True)["determined"]
    assert mapped(moving, compare=False)["determined"]


def test_a_photograph_at_a_wrong_place_agrees_with_hardly_any_match(rng):
    cameras = _cameras()
    matched = _matched(rng, cameras, [((0, 1, 2, 3, 4, 5), 200)], noise_px=0.0)
    lens = {"id": 1, "model": "SIMPLE_RADIAL", "width": 400, "height": 300}
    lens |= {"focal": [300.0, 300.0, 200.0, 150.0], "extra": [0.0]}

    def images(poses):
        return [{"index": i, "camera": lens, "camera_from_world": pose[:3]} for i, pose in enumerate(poses)]

    right = [camera.camera_from_world for camera in cameras]
    counts = agreements(images(right), matched, 0.5)
    assert all(tuple(counts[i]) == (1000, 1000) for i in range(6))
    wrong = [*right[:5], LENS.at(look_at((0.0, -2.9, 0.4), (0.5, 1.0, 1.5))).camera_from_world]
    counts = agreements(images(wrong), matched, 0.5)
    assert counts[5][0] < 100 and all(800 <= counts[i][0] < 900 for i in range(5))
