"""Dropout of Gaussians: each step of training does without a share of them, drawn anew.

With few photographs a pixel's colour is else shared out among Gaussians that are right only
together, from those very places. What must do without its neighbours now and then is right
by itself (Park et al. 2025, DropGaussian; Xu et al. 2025, DropoutGS).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from ..kernels.packing import LOGIT_OPACITY, NOWHERE, PackedGaussians


class Dropout:
    """Leaves each Gaussian out of a step with the probability ``share``, drawn from ``rng``.

    With a share of 0 nothing is drawn, and every step is as without.
    """

    def __init__(self, share: float, rng: np.random.Generator) -> None:
        self._share, self._rng = share, rng

    @contextmanager
    def one_step(self, gaussians: PackedGaussians) -> Iterator[None]:
        """While this lasts, the Gaussians left out have no opacity.

        So they are neither rendered nor, as nothing unseen is, moved; then their opacity is
        what it was. Those that stay are rendered as they are. Gaussians must not be added or
        moved about meanwhile.
        """
        if self._share <= 0.0:
            yield
            return
        logits = gaussians.values[:, LOGIT_OPACITY]
        left_out = self._rng.random(logits.shape, np.float32) < self._share
        before = logits.copy()
        np.copyto(logits, NOWHERE, where=left_out)
        try:
            yield
        finally:
            np.copyto(logits, before, where=left_out)
