"""Ways to the nearest of several places cost what the cheapest single one does."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from r2sego_blender.robot.planning.free_floor import CELL_M, FreeFloor
from r2sego_blender.robot.planning.navigation import path_between, ways_from


def floor_of(free: np.ndarray) -> FreeFloor:
    clearance_m = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1] * CELL_M
    return FreeFloor(np.zeros(2), free, free, clearance_m, 0.0)


@given(seed=st.integers(0, 10_000), count=st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_the_way_from_several_cells_is_the_shortest_of_the_ways_from_each(seed, count):
    rng = np.random.default_rng(seed)
    free = rng.random((9, 12)) < 0.7
    floor = floor_of(free)
    rows, columns = rng.integers(0, 9, count), rng.integers(0, 12, count)
    nearest, length_m = ways_from(floor, rows, columns)
    alone = np.array([ways_from(floor, rows[[i]], columns[[i]])[1] for i in range(count)])
    np.testing.assert_allclose(length_m, alone.min(axis=0), rtol=1e-12)
    for row, column in np.argwhere(np.isfinite(length_m)):
        np.testing.assert_allclose(alone[nearest[row, column], row, column], length_m[row, column], rtol=1e-12)
        start = int(rows[nearest[row, column]]), int(columns[nearest[row, column]])
        assert path_between(floor, (int(row), int(column)), start) is not None
    assert (nearest[~np.isfinite(length_m)] == -1).all()


def test_in_the_open_the_way_is_as_long_as_a_grid_of_eight_neighbours_has_it():
    floor = floor_of(np.ones((41, 41), bool))
    _, length_m = ways_from(floor, np.array([20]), np.array([20]))
    assert length_m[20, 20] == 0.0
    np.testing.assert_allclose(length_m[20, 25], 5 * CELL_M)
    np.testing.assert_allclose(length_m[25, 25], 5 * np.sqrt(2.0) * CELL_M)
