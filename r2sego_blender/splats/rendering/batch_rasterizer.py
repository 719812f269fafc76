"""Many small pictures at a time: each thread draws pictures of its own, in place of all threads drawing one."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from ...core.cameras import Camera
from ...core.threads import kernel_callers
from ..kernels.packing import PackedGaussians
from .rasterizer import Rasterizer


class BatchRasterizer:
    """Colours of ``asset`` from many cameras of one size, drawn by ``threads``, as many as Numba has where it is 0.

    A picture has the same bits as ``Rasterizer`` gives it. Pictures of thousands of pixels gain nothing by it. Use
    it as a context: it ends its threads.
    """

    def __init__(self, asset: PackedGaussians, threads: int = 0) -> None:
        self._asset, self._own = asset, threading.local()
        self._threads = threads or numba.get_num_threads()
        self._pool = ThreadPoolExecutor(self._threads, initializer=self._begin)

    def __enter__(self) -> BatchRasterizer:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def colours(self, cameras: Sequence[Camera]) -> np.ndarray:
        """(n, H, W, 3) float32, without a background."""
        height, width = cameras[0].shape
        drawn = np.empty((len(cameras), height, width, 3), np.float32)

        def draw(first: int, step: int) -> None:
            for number in range(first, len(cameras), step):
                rasterizer: Rasterizer = self._own.rasterizer
                rasterizer.forward(self._asset, cameras[number], with_depth=False)
                drawn[number] = rasterizer.colour

        threads = min(self._threads, kernel_callers())
        for done in [self._pool.submit(draw, number, threads) for number in range(threads)]:
            done.result()
        return drawn

    def _begin(self) -> None:
        numba.set_num_threads(1)  # of this thread alone
        self._own.rasterizer = Rasterizer()
