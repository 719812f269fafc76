from __future__ import annotations

import numpy as np
import pytest
from vector_calls import compiled, random

from r2sego_blender.splats.vector_language.lanes import (
    every_fourth,
    lane_sum,
    lane_sums,
    quarters_exchanged,
    side_by_side,
    transposed,
)
from r2sego_blender.splats.vector_language.vectors import LANES


@pytest.mark.parametrize("count", range(1, LANES + 1))
def test_sums_put_each_vectors_sum_in_the_lane_of_its_number(count: int) -> None:
    rows = random((count, LANES), count)
    both = compiled(lambda code, *v: [lane_sums(v), code.spread(lane_sum(v[-1]))], count)(rows)
    expected = rows.astype(np.float64).sum(axis=1)
    np.testing.assert_allclose(both[0, :count], expected, atol=1e-5)
    np.testing.assert_allclose(both[1], expected[-1], atol=1e-5)


def test_transposed_exchanges_lanes_and_numbers() -> None:
    rows = random((LANES, LANES))
    exchanged = compiled(lambda code, *v: transposed(v), LANES)
    np.testing.assert_array_equal(exchanged(rows), rows.T)
    np.testing.assert_array_equal(exchanged(exchanged(rows)), rows)


def test_quarters_and_numbers_are_exchanged() -> None:
    rows = random((4, LANES))
    exchanged = compiled(lambda code, *v: quarters_exchanged(v), 4)
    np.testing.assert_array_equal(exchanged(rows), rows.reshape(4, 4, 4).swapaxes(0, 1).reshape(4, LANES))
    np.testing.assert_array_equal(exchanged(exchanged(rows)), rows)


def test_columns_are_dealt_to_four_vectors_and_put_side_by_side_again() -> None:
    rows = random((4, LANES))
    dealt = compiled(lambda code, *v: every_fourth(v), 4)(rows)
    np.testing.assert_array_equal(dealt, rows.reshape(LANES, 4).T)
    np.testing.assert_array_equal(compiled(lambda code, *v: side_by_side(v), 4)(dealt), rows)
