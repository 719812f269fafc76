from __future__ import annotations

import numpy as np
from vector_calls import compiled, random

from r2sego_blender.splats.kernels.strip_blur import COLUMNS, VECTORS, between_dealt, dealt_row
from r2sego_blender.splats.vector_language.vectors import LANES

NEAR = 4


def check_line(own: np.ndarray, between: np.ndarray, columns: np.ndarray) -> None:
    """Lane by lane, a vector's neighbours lie beside it: ``columns`` begin a vector left of the strip."""
    for k in range(VECTORS):
        np.testing.assert_array_equal(own[k], columns[LANES + k : LANES + COLUMNS + k : VECTORS][:LANES])
        before = columns[k + LANES - VECTORS * NEAR : LANES : VECTORS]
        np.testing.assert_array_equal(between[k][-NEAR:], before)
        after = columns[LANES + COLUMNS + k :: VECTORS][:NEAR]
        np.testing.assert_array_equal(between[k + 1][:NEAR], after)


def test_a_dealt_rows_neighbours_lie_beside_its_vectors() -> None:
    columns = random((COLUMNS + 2 * LANES,))
    vectors = compiled(lambda code, *v: [x for part in dealt_row(v[0], v[1:-1], v[-1]) for x in part], VECTORS + 2)(
        columns.reshape(-1, LANES)
    )
    check_line(vectors[:VECTORS], vectors[VECTORS:], columns)


def test_what_lies_between_dealt_vectors_is_taken_from_the_strips_beside() -> None:
    columns = random((3 * COLUMNS,))
    strips = columns.reshape(3, LANES, VECTORS).transpose(0, 2, 1)
    between = compiled(lambda code, *v: between_dealt(v[:VECTORS], v[VECTORS:]), 2 * VECTORS)(
        np.concatenate([strips[0], strips[2]])
    )
    check_line(strips[1], between, columns[COLUMNS - LANES : 2 * COLUMNS + LANES])
