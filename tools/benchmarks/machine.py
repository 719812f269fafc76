"""This machine: its vector instructions, its peak rates in one thread, and memory used.

The peaks are measured, not looked up: two small kernels, one that does nothing but multiply and
add in registers and one that does nothing but pass through memory.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from llvmlite import binding as llvm
from numba.core.types import int64, void

from r2sego_blender.splats.kernels.compiled import kernel
from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

_ISAS = (
    ("avx512f", "avx512"),
    ("avx2", "avx2"),
    ("avx", "avx"),
    ("sse4.2", "sse4.2"),
    ("sve", "sve"),
    ("neon", "neon"),
    ("vsx", "vsx"),
)
"""LLVM's name of a feature and ours, widest first."""

_TRIALS = 5
_FMA_TURNS = 2_000_000
_MULTIPLIER, _ADDEND = 0.5, 1.0  # values stay between 0 and 2: nothing overflows, nothing is denormal
_TRIAD_BYTES = 64 << 20
"""Each of the triad's three arrays: far beyond a core's own caches."""


def isa() -> str:
    """The widest vector instructions of this processor, or ``generic``."""
    features = llvm.get_host_cpu_features()
    return next((name for feature, name in _ISAS if features.get(feature)), "generic")


_CHAINS = 12 if isa() == "avx512" else 6
"""Sums that do not wait for each other: enough to fill the units, few enough for the registers."""


def fma_rate_per_s() -> float:
    """Multiply-adds of sixteen lanes that one thread can do in a second, in registers."""
    values = aligned((_CHAINS, LANES))
    values[:] = np.arange(_CHAINS)[:, None] / _CHAINS
    address = values.ctypes.data
    _multiply_add(address, 1)
    return _CHAINS * _FMA_TURNS / _fastest_s(lambda: _multiply_add(address, _FMA_TURNS))


def bandwidth_bytes_per_s() -> float:
    """Bytes that one thread can read and write in a second, in the triad a = b + s c.

    Counted are the two arrays read and the one written, as STREAM does; that a written line
    may first be read is not counted.
    """
    arrays = [aligned(_TRIAD_BYTES // 4) for _ in range(3)]
    for value, array in enumerate(arrays):
        array[:] = value  # memory that was never written is not there yet
    target, a, b = (array.ctypes.data for array in arrays)
    vectors = _TRIAD_BYTES // VECTOR_BYTES
    _triad(target, a, b, 1)
    return 3 * _TRIAD_BYTES / _fastest_s(lambda: _triad(target, a, b, vectors))


def _fastest_s(run: Callable[[], None]) -> float:
    """The least time of some trials: other work on the machine only adds to it."""
    times_s = []
    for _ in range(_TRIALS):
        started_s = time.thread_time()
        run()
        times_s.append(time.thread_time() - started_s)
    return min(times_s)


@vector_kernel(void(int64, int64))
def _chains(code: Code, values: Value, turns: Value) -> None:
    """``turns`` multiply-adds in each chain; they stay in registers."""
    chains = [code.variable(code.load(values + k * VECTOR_BYTES)) for k in range(_CHAINS)]
    factor, addend = code.vector(_MULTIPLIER), code.vector(_ADDEND)
    with code.loop(turns):
        for chain in chains:
            chain.set(code.fma(chain.get(), factor, addend))
    for k, chain in enumerate(chains):
        code.store(values + k * VECTOR_BYTES, chain.get())


@vector_kernel(void(int64, int64, int64, int64))
def _pass(code: Code, target: Value, a: Value, b: Value, vectors: Value) -> None:
    with code.loop(vectors) as i:
        at = i * VECTOR_BYTES
        code.store(target + at, code.fma(code.load(b + at), _MULTIPLIER, code.load(a + at)))


@kernel
def _multiply_add(values: int, turns: int) -> None:
    _chains(values, turns)


@kernel
def _triad(target: int, a: int, b: int, vectors: int) -> None:
    _pass(target, a, b, vectors)
