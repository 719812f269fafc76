"""The grid of boxes against asking them all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.geometry.mesh.boxes import Boxes, touched


@given(st.integers(0, 2**32 - 1), st.integers(0, 300), st.sampled_from([2, 3]), st.floats(0.0, 3.0))
def test_the_same_boxes_are_met_as_when_all_are_asked(seed, count, dimensions, side):
    rng = np.random.default_rng(seed)
    low = rng.uniform(-5, 5, (count, dimensions))
    high = low + rng.uniform(0, 1, (count, dimensions)) ** 8 * rng.choice([0.0, 0.1, 12.0], (count, 1))
    boxes = Boxes(low, high)
    for start in rng.uniform(-8, 8, (20, dimensions)):
        end = start + side * rng.uniform(0, 1, dimensions)
        expected = np.flatnonzero(touched(low, high, start, end))
        np.testing.assert_array_equal(boxes.meeting(start, end), expected)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_borders_that_only_touch_are_met(dimensions):
    grid = np.stack(np.meshgrid(*[np.arange(6.0)] * dimensions), -1).reshape(-1, dimensions)
    boxes = Boxes(grid, grid + 1.0)
    for place in grid[(grid > 0).all(1)]:
        assert len(boxes.meeting(place, place)) == 2**dimensions


def test_boxes_in_one_place():
    low = np.ones((3, 3))
    boxes = Boxes(low, low)
    assert boxes.meeting(np.ones(3), np.ones(3)).tolist() == [0, 1, 2]
    assert boxes.meeting(np.full(3, 1.1), np.full(3, 2.0)).tolist() == []
