"""Processor time and memory that a process has used."""

import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender import resources

_ANEW = """
from r2sego_blender import resources
first = bytearray(128 << 20)
first[::4096] = b"x" * len(first[::4096])
del first
told = [resources.peak_memory_mb()]
resources.forget_peak_memory()
told.append(resources.peak_memory_mb())
second = bytearray(64 << 20)
second[::4096] = b"x" * len(second[::4096])
told.append(resources.peak_memory_mb())
print(*told)
"""


def test_memory_and_time_only_grow():
    before_s = resources.cpu_s()
    block = bytearray(32 << 20)
    peak_mb = resources.peak_memory_mb()
    assert peak_mb is None or peak_mb > 32
    del block
    assert peak_mb is None or resources.peak_memory_mb() > peak_mb - 1.0  # Linux counts by some pages
    assert resources.cpu_s() >= before_s


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="only Linux forgets the peak")
def test_the_peak_of_memory_can_begin_anew():
    """In a process of its own: here other tests' memory may be freed in between."""
    told = subprocess.run([sys.executable, "-c", _ANEW], capture_output=True, text=True, check=True).stdout
    whole_mb, forgotten_mb, anew_mb = map(float, told.split())
    assert forgotten_mb < whole_mb - 64
    assert forgotten_mb + 32 < anew_mb < whole_mb - 32
