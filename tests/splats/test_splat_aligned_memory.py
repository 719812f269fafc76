from __future__ import annotations

import numpy as np

from r2sego_blender.splats.aligned_memory import aligned, aligned_copy
from r2sego_blender.splats.vectors import VECTOR_BYTES


def test_memory_is_aligned_and_zero() -> None:
    for shape, dtype in (((3, 5), np.float32), (7, np.uint8), ((0, 16), np.float32), ((2, 3, 4), np.uint64)):
        array = aligned(shape, dtype)
        assert array.dtype == dtype and array.shape == (shape if isinstance(shape, tuple) else (shape,))
        assert array.ctypes.data % VECTOR_BYTES == 0 or not array.size
        assert not array.any()


def test_a_copy_of_memory_from_anywhere_is_aligned() -> None:
    values = aligned(40)[1:].reshape(3, 13)
    values[:] = np.arange(39).reshape(3, 13)
    copy = aligned_copy(values)
    assert values.ctypes.data % VECTOR_BYTES and copy.ctypes.data % VECTOR_BYTES == 0
    np.testing.assert_array_equal(copy, values)
    copy[:] = 0.0
    assert values[0, 1] == 1.0
