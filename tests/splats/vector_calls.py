"""Vector kernels as functions of arrays, for tests of what kernels are written with."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numba.core.types import int64, void

from r2sego_blender.splats.vector_language.aligned_memory import aligned
from r2sego_blender.splats.vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

Write = Callable[..., list[Value]]


def compiled(write: Write, inputs: int) -> Callable[[np.ndarray], np.ndarray]:
    """A function from (inputs, 16) to the vectors (n, 16) that ``write(code, *vectors)`` lists."""
    written = 0

    @vector_kernel(void(int64, int64))
    def body(code, source, target):
        nonlocal written
        rows = write(code, *(code.load(source + VECTOR_BYTES * k) for k in range(inputs)))
        written = len(rows)
        for k, row in enumerate(rows):
            code.store(target + VECTOR_BYTES * k, row)

    @numba.njit
    def call(source, target):
        body(source, target)

    def run(values: np.ndarray) -> np.ndarray:
        source, target = aligned((inputs, LANES)), aligned((64, LANES))
        source[:] = values
        call(source.ctypes.data, target.ctypes.data)
        return target[:written].copy()

    return run


def mapped(function: Callable[[Code, Value], Value], values: np.ndarray) -> np.ndarray:
    """A function of one vector at many values, float64 of float32 results."""

    @vector_kernel(void(int64, int64, int64))
    def body(code, source, target, count):
        with code.loop(count) as i:
            code.store(target + i * VECTOR_BYTES, function(code, code.load(source + i * VECTOR_BYTES)))

    @numba.njit
    def call(source, target, count):
        body(source, target, count)

    source, target = aligned((len(values) // LANES, LANES)), aligned((len(values) // LANES, LANES))
    source[:] = values.reshape(-1, LANES)
    call(source.ctypes.data, target.ctypes.data, len(source))
    return target.ravel().astype(np.float64)


def random(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def scalar_results(write: Callable[..., list[Value]], *arguments: int) -> list[int]:
    """The int64 values that ``write(code, *scalars)`` lists."""
    written = 0

    @vector_kernel(void(int64, int64))
    def body(code, source, target):
        nonlocal written
        results = write(code, *(code.load_long(source + 8 * k) for k in range(len(arguments))))
        written = len(results)
        for k, result in enumerate(results):
            code.store_long(target + 8 * k, result)

    @numba.njit
    def call(source, target):
        body(source, target)

    source, target = np.array([*arguments, 0], np.int64), np.zeros(64, np.int64)
    call(source.ctypes.data, target.ctypes.data)
    return target[:written].tolist()
