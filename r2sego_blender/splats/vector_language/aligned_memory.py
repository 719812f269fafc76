"""Arrays that kernels load whole vectors from: they start at a multiple of a vector's size.

Large ones ask for huge pages, where the system has them to give (Linux): the kernels reach
Gaussians and pixels all over megabytes, and a processor knows where few small pages lie.
"""

from __future__ import annotations

import mmap
from typing import Any

import numpy as np

from .vectors import VECTOR_BYTES

_HUGE_PAGE_BYTES = 2 << 20
_LARGE_BYTES = _HUGE_PAGE_BYTES // 2
"""From here on an array may fill a page of its own: on average half of the last one is lost."""

_HUGE_PAGES = getattr(mmap, "MADV_HUGEPAGE", None)


def aligned(shape: int | tuple[int, ...], dtype: Any = np.float32) -> np.ndarray:
    """Zeros whose memory starts at a multiple of a vector's size."""
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    large = _HUGE_PAGES is not None and count >= _LARGE_BYTES
    multiple = _HUGE_PAGE_BYTES if large else VECTOR_BYTES
    memory = _huge_pages(count + multiple) if large else np.zeros(count + multiple, np.uint8)
    start = -memory.ctypes.data % multiple
    return memory[start : start + count].view(dtype).reshape(shape)


def aligned_copy(values: np.ndarray) -> np.ndarray:
    """The same values, float32, at an aligned place."""
    copy = aligned(values.shape)
    copy[:] = values
    return copy


def _huge_pages(count: int) -> np.ndarray:
    """Zeros (count,) uint8, in huge pages if the system has some left."""
    try:
        pages = mmap.mmap(-1, count, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        assert _HUGE_PAGES is not None
        pages.madvise(_HUGE_PAGES)
    except OSError:  # a kernel without them; or no memory, which NumPy tells in its own words
        return np.zeros(count, np.uint8)
    return np.frombuffer(pages, np.uint8)
