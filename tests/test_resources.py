"""Processor time and memory that a process has used."""

from r2sego_blender import resources


def test_memory_and_time_only_grow():
    before_s = resources.cpu_s()
    block = bytearray(32 << 20)
    peak_mb = resources.peak_memory_mb()
    assert peak_mb is None or peak_mb > 32
    del block
    assert resources.peak_memory_mb() == peak_mb
    assert resources.cpu_s() >= before_s


def test_the_peak_of_memory_can_begin_anew():
    resources.forget_peak_memory()
    before_mb = resources.peak_memory_mb()
    if before_mb is None:
        return
    block = bytearray(64 << 20)
    block[::4096] = b"x" * len(block[::4096])
    assert resources.peak_memory_mb() > before_mb + 32
