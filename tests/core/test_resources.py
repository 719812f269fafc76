"""Processor time and memory that a process has used."""

import subprocess
import sys
from pathlib import Path

import pytest

from r2sego_blender.core import resources

_ANEW = """
from r2sego_blender.core import resources
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


@pytest.fixture
def on_64_cores(monkeypatch):
    monkeypatch.setattr(resources.os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr(resources, "_QUOTA", Path("/nowhere/cpu.max"))
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)


@pytest.mark.parametrize(
    ("quota", "cores"),
    [("max 100000", 64), ("400000 100000", 4), ("150000 100000", 2), ("9900000 100000", 64), ("", 64)],
)
def test_a_container_has_its_share_of_the_cores(on_64_cores, monkeypatch, tmp_path, quota, cores):
    (tmp_path / "cpu.max").write_text(f"{quota}\n")
    monkeypatch.setattr(resources, "_QUOTA", tmp_path / "cpu.max")
    assert resources.available_cores() == cores


@pytest.mark.parametrize(("threads", "cores"), [("8", 8), ("200", 64), ("0", 1), ("many", 64)])
def test_a_scene_among_many_gets_the_cores_it_was_given(on_64_cores, monkeypatch, threads, cores):
    assert resources.available_cores() == 64
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    assert resources.available_cores() == cores


def test_too_small_a_limit_of_addresses_is_an_error_and_no_hang():
    """Below it OpenBLAS may never come back."""
    limits = pytest.importorskip("resource")

    def plan(mb: int) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "r2sego_blender", "plan", "nowhere.r2s"],
            timeout=60,
            capture_output=True,
            text=True,
            preexec_fn=lambda: limits.setrlimit(limits.RLIMIT_AS, (mb * 10**6, limits.RLIM_INFINITY)),
        )
        assert done.returncode == 1
        return done.stderr

    assert plan(400).startswith("r2sego: ulimit -v: a process may use only 400 MB of addresses here. ")
    assert "nowhere.r2s" in plan(4000)


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


_LIMITED = """
import numpy
from r2sego_blender.core.resources import limit_memory
limit_memory(256 << 20)
numpy.ones(64 << 20, numpy.uint8)
try:
    numpy.ones(1 << 30, numpy.uint8)
except MemoryError:
    print("refused")
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux limits addresses")
def test_a_child_takes_no_more_memory_than_it_may():
    told = subprocess.run([sys.executable, "-c", _LIMITED], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "refused"


def test_the_processor_has_a_name():
    assert resources.processor().strip()
