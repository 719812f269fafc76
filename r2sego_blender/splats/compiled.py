"""The kernel decorators of this package: a division does not raise, but gives inf or NaN.

Python's check for a zero divisor is a branch, and a loop with a branch is not vectorised.
"""

from __future__ import annotations

import functools

from ..compiled import FAST, inlined, prange
from ..compiled import kernel as _kernel
from ..compiled import parallel_kernel as _parallel_kernel

_OPTIONS = {"error_model": "numpy", "fastmath": FAST}

kernel = functools.partial(_kernel, **_OPTIONS)
parallel_kernel = functools.partial(_parallel_kernel, **_OPTIONS)

__all__ = ["inlined", "kernel", "parallel_kernel", "prange"]
