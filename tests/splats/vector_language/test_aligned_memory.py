from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.splats.vector_language import aligned_memory
from r2sego_blender.splats.vector_language.aligned_memory import aligned, aligned_copy
from r2sego_blender.splats.vector_language.vectors import VECTOR_BYTES


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


LARGE = (5, 1 << 18)  # 5 MiB of float32


def _no_memory(*_: object, **__: object) -> None:
    raise OSError(12, "Cannot allocate memory")


@pytest.mark.parametrize("system", ["as it is", "without huge pages", "without a mapping"])
def test_large_arrays_are_zero_and_can_be_written(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if system == "without huge pages":
        monkeypatch.setattr(aligned_memory, "_HUGE_PAGES", None)
    if system == "without a mapping":
        monkeypatch.setattr(aligned_memory.mmap, "mmap", _no_memory)
    first, second = aligned(LARGE), aligned(LARGE)
    assert first.ctypes.data % VECTOR_BYTES == 0 and not first.any()
    first[:] = np.arange(first.size, dtype=np.float32).reshape(LARGE)
    assert first[4, -1] == first.size - 1 and not second.any()


def test_large_arrays_go_back_to_the_system() -> None:
    def mapped_kib() -> int:
        return int(Path("/proc/self/status").read_text().split("VmSize:")[1].split()[0])

    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process' memory in /proc")
    arrays = [aligned(LARGE) for _ in range(20)]
    kept, part = mapped_kib(), arrays[0][2:3]
    del arrays
    assert mapped_kib() < kept - 90 * 1024
    part[:] = 1.0  # a view keeps its array
    assert part.sum() == LARGE[1]
