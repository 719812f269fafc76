"""Many like pieces of work on all cores, in threads: for kernels and libraries that let the other threads run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .progress import Progress
from .resources import available_cores

Item = TypeVar("Item")
Result = TypeVar("Result")

BLAS_VARIABLE = "OPENBLAS_NUM_THREADS"
"""Says how many threads OpenBLAS has when it is loaded. A second one spins between calls: of the bundle
adjustment's many small matrices half the processor's time went there."""


def in_threads(
    work: Callable[[Item], Result], items: Iterable[Item], progress: Progress, title: str
) -> Iterator[Result]:
    """``work`` of each of the ``items``, in their order, with a unit of ``progress`` each.

    The first error of one ends it, as does who takes no more; pieces that have not begun then never do.
    """
    given = list(items)
    pool = ThreadPoolExecutor(available_cores())
    try:
        found = pool.map(work, given)
        for _ in progress.track(given, title):
            yield next(found)
    finally:
        pool.shutdown(cancel_futures=True)
