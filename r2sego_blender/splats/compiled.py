"""The kernel decorators of this package: a division does not raise, but gives inf or NaN.

Python's check for a zero divisor is a branch, and a loop with a branch is not vectorised.
"""

from __future__ import annotations

import functools

from numba import get_num_threads

from ..compiled import FAST, inlined, prange
from ..compiled import kernel as _kernel
from ..compiled import parallel_kernel as _parallel_kernel

_OPTIONS = {"error_model": "numpy", "fastmath": FAST}

kernel = functools.partial(_kernel, **_OPTIONS)
parallel_kernel = functools.partial(_parallel_kernel, **_OPTIONS)


@inlined
def turns(pieces, run):
    """How many pieces each thread gets when they are dealt to the threads in runs, as ``dealt`` does.

    A thread gets consecutive numbers of a ``prange``: neighbouring tiles, one with the floor
    and all that stands on it, the other with a bare wall. So the numbers from 0 to before
    ``turns * get_num_threads()`` are looped over, and ``dealt`` says which piece is meant.
    """
    rounds = (pieces + run * get_num_threads() - 1) // (run * get_num_threads())
    return rounds * run


@inlined
def dealt(number, turns, run):
    """The piece of this number; there may be none, then it is not below the number of pieces."""
    turn = number % turns
    return (turn // run * get_num_threads() + number // turns) * run + turn % run


__all__ = ["dealt", "get_num_threads", "inlined", "kernel", "parallel_kernel", "prange", "turns"]
