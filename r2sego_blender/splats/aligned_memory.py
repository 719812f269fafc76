"""Arrays that kernels load whole vectors from: they start at a multiple of a vector's size."""

from __future__ import annotations

from typing import Any

import numpy as np

from .vectors import VECTOR_BYTES


def aligned(shape: int | tuple[int, ...], dtype: Any = np.float32) -> np.ndarray:
    """Zeros whose memory starts at a multiple of a vector's size."""
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(count + VECTOR_BYTES, np.uint8)
    start = -memory.ctypes.data % VECTOR_BYTES
    return memory[start : start + count].view(dtype).reshape(shape)


def aligned_copy(values: np.ndarray) -> np.ndarray:
    """The same values, float32, at an aligned place."""
    copy = aligned(values.shape)
    copy[:] = values
    return copy
