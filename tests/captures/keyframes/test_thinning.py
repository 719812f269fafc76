"""Which pictures of a walk are kept: facts that hold for any, and those of a room that is known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from phone_videos import walk
from scipy.sparse.csgraph import connected_components

from r2sego_blender.captures.keyframes.thinning import likeness, sharpest_of_parts, thinned
from r2sego_blender.captures.sharpness import reduced_grey, sharpness
from r2sego_blender.core.images import to_uint8

WAYS = st.lists(st.one_of(st.floats(0.0, 1.0), st.just(float("nan"))), min_size=1, max_size=40)


@given(WAYS, st.integers(1, 12), st.integers(0, 1000))
def test_parts_give_their_sharpest(ways, parts, seed):
    sharp = np.random.default_rng(seed).random(len(ways))
    kept = sharpest_of_parts(np.array(ways), sharp, parts)
    assert 1 <= len(kept) <= parts
    assert (np.diff(kept) > 0).all()
    assert sharp.argmax() in kept


def test_parts_are_equally_long_in_way_and_not_in_time():
    """A camera that rests for most of the time, and then walks."""
    ways = np.array([0.0] * 90 + [1.0] * 10)
    kept = sharpest_of_parts(ways, np.ones(100), 10)
    assert (kept >= 89).sum() >= 8


def any_likeness(total, linked, seed):
    """The likeness of so many pictures, of which a share of the pairs is linked."""
    rng = np.random.default_rng(seed)
    alike = np.triu(rng.random((total, total)) * (rng.random((total, total)) < linked), 1)
    return alike + alike.T


@given(st.integers(3, 25), st.integers(1, 25), st.integers(0, 1000))
def test_as_many_are_kept_as_are_asked_for(total, count, seed):
    kept = thinned(any_likeness(total, 0.5, seed), np.random.default_rng(seed).random(total), count)
    assert len(kept) == min(total, count)
    assert (np.diff(kept) > 0).all()


def components(alike, kept):
    return connected_components(alike[np.ix_(kept, kept)] > 0.0)[0]


@given(st.integers(3, 25), st.integers(1, 25), st.integers(0, 1000))
def test_what_hangs_together_still_does(total, count, seed):
    alike = any_likeness(total, 0.2, seed)
    kept = thinned(alike, np.ones(total), count)
    linked = np.flatnonzero(alike.max(axis=1) > 0.0)
    if count <= len(linked):
        assert components(alike, kept) <= components(alike, linked)


@pytest.mark.parametrize("count", [30, 60, 120])
def test_a_walk_stays_one_from_its_begin_to_its_end(rng, count):
    """Pictures a metre apart show nothing in common; the walk has twenty."""
    place = np.sort(rng.random(240)) * 20.0
    alike = np.clip(1.0 - np.abs(place[:, None] - place), 0.0, 1.0) - np.eye(240)
    kept = thinned(alike, np.ones(240), count)
    assert components(alike, kept) == 1
    assert place[kept[0]] < 0.8 and place[kept[-1]] > 19.2
    assert np.diff(place[kept]).max() < 1.0


def test_where_too_few_are_wanted_those_that_are_kept_hang_together(rng):
    place = np.sort(rng.random(240)) * 20.0
    alike = np.clip(1.0 - np.abs(place[:, None] - place), 0.0, 1.0) - np.eye(240)
    kept = thinned(alike, np.ones(240), 8)
    assert components(alike, kept) == 1 and np.ptp(place[kept]) > 3.0


def test_of_places_where_the_camera_rests_one_picture_stays_each():
    place = np.repeat([0, 1, 2, 3], [6, 1, 4, 2])
    alike = np.where(place[:, None] == place, 0.9, 0.3) - np.eye(len(place)) * 0.9
    sharp = np.linspace(1.0, 1.3, len(place))
    assert place[thinned(alike, sharp, 4)].tolist() == [0, 1, 2, 3]


def test_what_is_blurred_or_shares_nothing_goes_first():
    alike = np.full((9, 9), 0.3) - 0.3 * np.eye(9)
    alike[4], alike[:, 4] = 0.0, 0.0
    sharp = np.ones(9)
    sharp[6] = 0.2
    assert thinned(alike, sharp, 7).tolist() == [0, 1, 2, 3, 5, 7, 8]


@pytest.fixture(scope="module")
def greys(room):
    """The walk's first picture; the same again, after a turn on the spot, after a step as wide, elsewhere; noise."""
    here = walk(0.0)
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(np.array([0.0, 0.1, 0.0]))[0]
    cameras = [here, here, here.at(here.world_from_camera @ turn), walk(0.2), walk(0.9)]
    noise = np.random.default_rng(0).integers(0, 255, (320, 240, 3), np.uint8)
    return [reduced_grey(one) for one in [*(to_uint8(room.image(camera)) for camera in cameras), noise]]


def test_pictures_are_alike_as_they_show_the_same(greys):
    same, turned, stepped, far, noise = likeness(greys)[0, 1:]
    assert same > 0.95
    assert same > turned > stepped > far >= 0.0
    assert noise == 0.0


def test_blur_lowers_sharpness_however_it_comes(greys):
    along = np.zeros((9, 9), np.float32)
    along[4] = 1.0 / 9.0
    sharp = sharpness(greys[0])
    assert sharpness(cv2.filter2D(greys[0], -1, along)) < 0.5 * sharp
    assert sharpness(cv2.GaussianBlur(greys[0], (0, 0), 2.0)) < 0.2 * sharp
    assert sharpness(greys[2]) == pytest.approx(sharp, rel=0.5)
