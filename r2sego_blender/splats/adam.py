"""Adam (Kingma and Ba 2015) over the Gaussians an image touches.

A Gaussian that took no part in a step keeps its moments, and each Gaussian has its own
step count for the bias correction: one first seen late would else start with steps six
times too long.
"""

from __future__ import annotations

import math

import numpy as np

from .asset import SplatAsset
from .compiled import kernel, parallel_kernel, prange
from .projection import PARTS
from .rasterizer import Gradients

_BETA_1, _BETA_2 = 0.9, 0.999
_B1, _B2 = np.float32(_BETA_1), np.float32(_BETA_2)
_EPSILON = np.float32(1e-15)
_NEGLIGIBLE = np.float32(1e-30)  # decaying moments end here, before they become denormal
_0, _1 = np.float32(0), np.float32(1)
_CORRECTED_STEPS = 16384
_BLOCK = 256


@kernel
def _update_row(values, gradients, first, second, rates, corrected):
    for k in range(values.shape[0]):
        gradient = gradients[k]
        m = _B1 * first[k] + (_1 - _B1) * gradient
        v = _B2 * second[k] + (_1 - _B2) * gradient * gradient
        values[k] -= rates[k] * corrected * m / (math.sqrt(v) + _EPSILON)
        first[k] = m if abs(m) > _NEGLIGIBLE else _0
        second[k] = v if v > _NEGLIGIBLE else _0


@parallel_kernel
def _update(touched, steps, corrections, values, gradients, first, second, rates, columns):
    """One step of the parameters (N, C) whose first ``columns`` are in use."""
    count = touched.shape[0]
    blocks = (count + _BLOCK - 1) // _BLOCK
    for part in prange(PARTS):
        for block in range(part, blocks, PARTS):
            for i in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
                if touched[i]:
                    corrected = corrections[min(steps[i], _CORRECTED_STEPS - 1)]
                    _update_row(
                        values[i, :columns], gradients[i, :columns], first[i], second[i], rates, corrected
                    )


class Adam:
    """The optimiser's state for one asset, whose arrays it changes in place."""

    def __init__(self, asset: SplatAsset) -> None:
        self._asset = asset
        self._steps = np.zeros(len(asset), np.int32)
        step = np.arange(_CORRECTED_STEPS, dtype=np.float64)
        step[0] = 1.0
        self._corrections = (np.sqrt(1.0 - _BETA_2**step) / (1.0 - _BETA_1**step)).astype(np.float32)
        self._moments = {
            name: np.zeros((2, len(asset), self._columns(getattr(asset, name)).shape[1]), np.float32)
            for name in ("means", "log_scales", "quaternions", "logit_opacities", "sh")
        }

    def step(self, gradients: Gradients, rates: dict[str, float], degree: int) -> None:
        """Update the touched Gaussians, harmonics up to ``degree``.

        ``rates`` has the learning rates of the parameter groups by their names in
        SplatAsset, and ``sh_rest`` for the harmonics above degree 0.
        """
        touched = gradients.touched
        self._steps += touched
        for name, (first, second) in self._moments.items():
            values = self._columns(getattr(self._asset, name))
            columns = 3 * (degree + 1) ** 2 if name == "sh" else values.shape[1]
            rate = np.full(values.shape[1], rates[name], np.float32)
            if name == "sh":
                rate[3:] = rates["sh_rest"]
            _update(
                touched, self._steps, self._corrections, values, self._columns(getattr(gradients, name)),
                first, second, rate, columns,
            )  # fmt: skip

    @staticmethod
    def _columns(values: np.ndarray) -> np.ndarray:
        return values.reshape(len(values), values.size // max(len(values), 1))
