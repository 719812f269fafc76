from __future__ import annotations

import numba
import numpy as np
import pytest
from numba.core.types import int64, void

from r2sego_blender.splats.vector_language.stages import in_stages
from r2sego_blender.splats.vector_language.vectors import vector_kernel


@pytest.mark.parametrize("bits", [0, 1, 2**63 - 1, 0b1011, 1 << 40, -1, -(2**63)])
def test_stages_are_done_in_order_for_each_set_bit(bits: int) -> None:
    @vector_kernel(void(int64, int64))
    def body(code, bits, target):
        count = code.variable(code.long(0))

        def finish(values):
            code.store_long(target + count.get() * 8, values[0])
            count.add(code.long(1))

        in_stages(bits, lambda bit: [bit, bit * 3], lambda x: [x[0] + x[1] * 100], finish)

    @numba.njit
    def call(bits, target):
        body(bits, target)

    found = np.full(65, -1, np.int64)
    call(bits, found.ctypes.data)
    expected = [301 * k for k in range(64) if bits >> k & 1]
    assert found[: len(expected)].tolist() == expected
    assert (found[len(expected) :] == -1).all()
