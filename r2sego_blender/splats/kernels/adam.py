"""What a step of Adam leaves for the next one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..vector_language.aligned_memory import aligned
from ..vector_language.vectors import LANES
from .packing import PackedGaussians


@dataclass
class AdamState:
    """What Adam remembers of packed Gaussians, for all chunks they have room for.

    ``first`` and ``second`` are the moments; ``steps`` (chunks, 16) each Gaussian's number of
    steps; ``statistics`` (chunks, 2, 16) add up how far the loss would move its centre, in
    half images, and the images it was blended into.
    """

    first: np.ndarray
    second: np.ndarray
    steps: np.ndarray
    statistics: np.ndarray

    @staticmethod
    def of(gaussians: PackedGaussians) -> AdamState:
        shape = gaussians.chunks.shape
        return AdamState(aligned(shape), aligned(shape), aligned((shape[0], LANES)), aligned((shape[0], 2, LANES)))
