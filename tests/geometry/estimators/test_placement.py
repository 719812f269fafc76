"""Where photographs lie in models' pictures, by hand from the models' own code, and depth of them taken back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.core.cameras import Camera
from r2sego_blender.geometry.estimators import depth_anything_3, dust3r, mapanything, moge, vggt
from r2sego_blender.geometry.estimators.placement import Placement

PLANE = np.array([0.13, -0.21, 0.4])
"""(3,): its points X in the camera's frame have PLANE @ X = 1, so inverse depth is PLANE @ ray."""

BY_HAND = {
    # Longer side to 504, each side to the nearest multiple of 14: 1080 * 504 / 1920 = 283.5, 280 is nearer than 294.
    depth_anything_3: [
        ((4000, 3000), (504, 378, 504, 378, 0, 0)),
        ((1920, 1080), (504, 280, 504, 280, 0, 0)),
        ((1080, 1920), (280, 504, 280, 504, 0, 0)),
    ],
    # Scaled to cover the picture of the nearest aspect, rounded down, cropped about the middle.
    mapanything: [
        ((640, 480), (518, 392, 522, 392, -2, 0)),
        ((1920, 1080), (518, 294, 522, 294, -2, 0)),
        ((480, 640), (392, 518, 392, 522, 0, -2)),
        ((1000, 1000), (518, 518, 518, 518, 0, 0)),
    ],
    # Longer side 960, nothing else.
    moge: [((640, 480), (960, 720, 960, 720, 0, 0)), ((1080, 1920), (540, 960, 540, 960, 0, 0))],
    # Longer side 512, cropped about the middle to multiples of 16: 1000 * 512 / 1500 = 341 -> 336; squares to 4 : 3.
    dust3r: [
        ((640, 480), (512, 384, 512, 384, 0, 0)),
        ((1500, 1000), (512, 336, 512, 341, 0, -2)),
        ((480, 640), (384, 512, 384, 512, 0, 0)),
        ((800, 800), (512, 384, 512, 512, 0, -64)),
    ],
}


def inverse_depth(matrix: np.ndarray, height: int, width: int) -> np.ndarray:
    """(H, W) of PLANE by intrinsics whose pixel centres are at half-integers."""
    v, u = np.mgrid[:height, :width] + 0.5
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1], np.ones_like(u)], axis=-1)
    return rays @ PLANE


@pytest.mark.parametrize(
    ("model", "size", "place"), [(model, *one) for model, table in BY_HAND.items() for one in table]
)
def test_a_photograph_lies_where_the_models_own_code_puts_it(model, size, place):
    (found,) = model.Estimator("").placements([size])
    assert found == Placement(*place)


def test_vggt_fills_its_pictures_with_landscapes_of_one_shape_and_pads_any_others_to_squares():
    estimator = vggt.Estimator("vggt")
    # 480 * 518 / 640 = 388.5, 27.75 patches of 14: 28.
    assert estimator.placements([(640, 480), (1600, 1200)]) == [Placement(518, 392, 518, 392)] * 2
    assert estimator.placements([(640, 480), (480, 640)]) == [
        Placement(518, 518, 518, 392, 0, 63),
        Placement(518, 518, 392, 518, 63, 0),
    ]
    assert estimator.placements([(480, 640)]) == [Placement(518, 518, 392, 518, 63, 0)]


def test_the_pictures_lens_by_hand():
    camera = Camera(640, 480, 500.0, 510.0, 330.0, 236.0, np.eye(4))
    matrix = Placement(518, 392, 522, 392, -2, 0).matrix(camera)
    np.testing.assert_allclose(matrix, [[407.8125, 0, 267.15625], [0, 416.5, 192.733333], [0, 0, 1]], rtol=1e-7)


sides = st.integers(40, 700)


@settings(max_examples=40, deadline=None)
@given(
    model=st.sampled_from([*BY_HAND, vggt]),
    size=st.tuples(sides, sides).filter(lambda one: 0.4 < one[0] / one[1] < 2.5),
    focal=st.floats(0.6, 1.5),
    centre=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
)
def test_a_planes_depth_comes_back_exactly_and_what_was_cropped_is_unknown(model, size, focal, centre):
    width, height = size
    longest = max(size)
    camera = Camera(
        width,
        height,
        focal * longest,
        focal * longest,
        (0.5 + centre[0]) * width,
        (0.5 + centre[1]) * height,
        np.eye(4),
    )
    (place,) = model.Estimator("").placements([size])
    said = inverse_depth(place.matrix(camera), place.height, place.width)
    assert 1 / said.max() > 0 and said.min() > 0
    # What lies in the padding must not be taken for depth of the photograph.
    rows, columns = np.mgrid[: place.height, : place.width]
    beside = (rows < place.top) | (rows >= place.top + place.down)
    beside |= (columns < place.left) | (columns >= place.left + place.across)
    smaller = place.photographs(camera)
    found = place.depth(np.where(beside, 1e3, 1.0 / said).astype(np.float32), smaller)
    true = 1.0 / inverse_depth(smaller.matrix, *smaller.shape)
    known = found > 0
    np.testing.assert_allclose(found[known], true[known], rtol=1e-4)
    v = place.top + (np.arange(smaller.height) + 0.5) * place.down / smaller.height
    u = place.left + (np.arange(smaller.width) + 0.5) * place.across / smaller.width
    seen = ((v >= 0) & (v < place.height))[:, None] & ((u >= 0) & (u < place.width))[None, :]
    np.testing.assert_array_equal(known, seen)


def test_where_two_surfaces_meet_no_depth_lies_between_them():
    camera = Camera(80, 60, 70.0, 70.0, 40.0, 30.0, np.eye(4))
    said = np.where(np.arange(96) < 41, 1.0, 4.0) * np.ones((72, 1))
    found = Placement(96, 72, 96, 72).depth(said.astype(np.float32), camera)
    assert set(np.unique(found)) == {np.float32(1.0), np.float32(4.0)}


def test_what_a_model_does_not_know_stays_unknown():
    camera = Camera(40, 30, 30.0, 30.0, 20.0, 15.0, np.eye(4))
    said = np.full((30, 40), 2.0, np.float32)
    said[3, 4], said[5, 6], said[7, 8], said[9, 10] = np.nan, np.inf, -1.0, 0.0
    found = Placement(40, 30, 40, 30).depth(said, camera)
    assert np.argwhere(found == 0).tolist() == [[3, 4], [5, 6], [7, 8], [9, 10]]
    assert (found[found > 0] == 2.0).all()


def test_the_picture_shows_the_photograph_and_its_padding():
    photograph = np.zeros((60, 40, 3), np.float32)
    photograph[:, :, 0] = np.linspace(0, 1, 60, dtype=np.float32)[:, None]
    padded = Placement(60, 60, 40, 60, 10, 0).picture(photograph)
    assert (padded[:, :10] == 255).all() and (padded[:, 50:] == 255).all()
    np.testing.assert_array_equal(padded[:, 10:50, 0], np.rint(255 * photograph[..., 0]))
    cropped = Placement(40, 40, 40, 60, 0, -10).picture(photograph)
    np.testing.assert_array_equal(cropped[..., 0], np.rint(255 * photograph[10:50, :, 0]))
