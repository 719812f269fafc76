"""Many like pieces of work on all cores, in threads: for kernels and libraries that let the other threads run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .progress import SILENT, Progress
from .resources import available_cores

Item = TypeVar("Item")
Result = TypeVar("Result")

_ONE_CALLER = "workqueue"
"""The threading layer of Numba that ends the process when two threads call parallel kernels."""

BLAS_VARIABLE = "OPENBLAS_NUM_THREADS"
"""Says how many threads OpenBLAS has when it is loaded. A second one spins between calls: of the bundle
adjustment's many small matrices half the processor's time went there."""


def in_threads(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    progress: Progress = SILENT,
    title: str = "",
    threads: int = 0,
) -> Iterator[Result]:
    """``work`` of each of the ``items``, in their order, with a unit of ``progress`` each.

    So many ``threads`` work, as many as there are cores where it is 0. The first error of one ends it, as does who
    takes no more; pieces that have not begun then never do.
    """
    given = list(items)
    pool = ThreadPoolExecutor(threads or available_cores())
    try:
        found = pool.map(work, given)
        for _ in progress.track(given, title):
            yield next(found)
    finally:
        pool.shutdown(cancel_futures=True)


def in_threads_of_kernels(
    work: Callable[[Item], Result], items: Iterable[Item], at_a_time: int = 0
) -> Iterator[Result]:
    """``in_threads`` of work that calls parallel kernels, which hardly keep all cores busy by themselves.

    Those that run at a time, all that can where ``at_a_time`` is 0, share the cores.
    """
    import numba  # not where threads are asked for alone: commands would wait for it

    given = list(items)
    cores = numba.get_num_threads()
    callers = max(1, min(at_a_time or cores, kernel_callers(), len(given)))

    def with_its_share(place: int) -> Result:
        beside = min(callers, len(given) - place // callers * callers)  # the last ones may be fewer
        numba.set_num_threads(max(1, cores // beside))  # of this thread alone
        return work(given[place])

    return in_threads(with_its_share, range(len(given)), threads=callers)


def kernel_callers() -> int:
    """As many threads as may call parallel kernels at a time and have a core each."""
    import numba

    cores: int = numba.get_num_threads()  # loads the threading layer
    return 1 if numba.threading_layer() == _ONE_CALLER else cores
