from __future__ import annotations

import platform

import numba
import numpy as np
import pytest
from numba.core.types import int32, void

from r2sego_blender.splats.vector_language.denormals import flush_denormals, restore_denormals


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="only x86 is told to flush")
def test_denormals_are_flushed_until_the_state_is_restored() -> None:
    @numba.njit
    def begin():
        return flush_denormals()

    @numba.njit(void(int32))
    def end(state):
        restore_denormals(state)

    def product() -> float:
        return float((np.full(3, 1e-30, np.float32) * np.float32(1e-10))[0])

    before = begin()
    try:
        flushed, inner = product(), begin()
        end(inner)
        still_flushed = product()
    finally:
        end(before)
    assert flushed == still_flushed == 0.0
    assert product() == pytest.approx(1e-40, rel=1e-4)
    again = begin()
    end(before)
    status_flags = 0x3F  # of past operations, not settings
    assert again & ~status_flags == before & ~status_flags
