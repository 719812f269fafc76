"""The kernel decorators of this package: a division does not raise, but gives inf or NaN.

Python's check for a zero divisor is a branch, and a loop with a branch is not vectorised.
"""

from __future__ import annotations

import functools

from ...core.compiled import FAST, KernelDecorator, inlined, prange
from ...core.compiled import kernel as _kernel
from ...core.compiled import parallel_kernel as _parallel_kernel

_OPTIONS = {"error_model": "numpy", "fastmath": FAST}

kernel: KernelDecorator = functools.partial(_kernel, **_OPTIONS)
parallel_kernel: KernelDecorator = functools.partial(_parallel_kernel, **_OPTIONS)


@inlined
def turns(pieces, run, threads):
    """How many pieces each thread gets when they are dealt to the threads in runs, as ``dealt`` does.

    A thread gets consecutive numbers of a ``prange``: neighbouring tiles, one with the floor
    and all that stands on it, the other with a bare wall. So the numbers from 0 to before
    ``turns * threads`` are looped over, and ``dealt`` says which piece is meant. The number of
    threads is an argument of the kernels: one that asks for it cannot be cached.
    """
    return (pieces + run * threads - 1) // (run * threads) * run


@inlined
def dealt(number, turns, run, threads):
    """The piece of this number; there may be none, then it is not below the number of pieces."""
    turn = number % turns
    return (turn // run * threads + number // turns) * run + turn % run


__all__ = ["dealt", "inlined", "kernel", "parallel_kernel", "prange", "turns"]
