"""Dropout of Gaussians: each step of training does without a share of them, drawn anew.

With few photographs a pixel's colour is else shared out among Gaussians that are right only
together, from those very places. What must do without its neighbours now and then is right
by itself (Park et al. 2025, DropGaussian; Xu et al. 2025, DropoutGS).
"""

from __future__ import annotations

import numpy as np

from ..vector_language.vectors import LANES


class Dropout:
    """Leaves each Gaussian out of a step with the probability ``share``, drawn from ``rng``.

    With a share of 0 nothing is drawn, and every step is as without.
    """

    def __init__(self, share: float, rng: np.random.Generator) -> None:
        self._share, self._rng = share, rng

    def drawn(self, count: int) -> np.ndarray | None:
        """Which of ``count`` packed Gaussians to leave out, their chunks' places (chunks, 16) bool."""
        if self._share <= 0.0:
            return None
        return self._rng.random((-(-count // LANES), LANES), np.float32) < self._share
