"""The default engine: our kernels, on the packed Gaussians themselves. The same bits for any threads."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from ...core.cameras import Camera
from ..kernels.adam import AdamState
from ..kernels.packing import LOG_SCALE, LOGIT_OPACITY, NOWHERE, QUATERNION, PackedGaussians
from ..rendering.rasterizer import Background, Rasterizer

BACKENDS = {"cpu": "embedded: 3DGS on the CPU"}
ORDER = 0


def require() -> None:
    """It runs everywhere."""


class CpuBackend:
    """See ``SplatBackend``."""

    def __init__(self, gaussians: PackedGaussians, state: AdamState) -> None:
        self.gaussians = gaussians
        self._state, self._rasterizer = state, Rasterizer()

    def __len__(self) -> int:
        return len(self.gaussians)

    def forward(
        self, camera: Camera, background: Background, degree: int, with_depth: bool, dilation_px2: float
    ) -> None:
        self._rasterizer.forward(self.gaussians, camera, background, degree, with_depth, dilation_px2=dilation_px2)

    @property
    def planes(self) -> np.ndarray:
        return self._rasterizer.planes

    @property
    def gradient_planes(self) -> np.ndarray:
        return self._rasterizer.gradient_planes

    def step(
        self,
        rates: np.ndarray,
        opacity_regularization: float,
        scale_regularization: float,
        with_alpha: bool,
        with_depth: bool,
    ) -> None:
        self._rasterizer.step(self._state, rates, opacity_regularization, scale_regularization, with_alpha, with_depth)

    def pose_gradient(self) -> np.ndarray:
        return self._rasterizer.pose_gradient()

    @contextlib.contextmanager
    def leaving_out(self, left_out: np.ndarray | None) -> Iterator[None]:
        """Those left out have no opacity: so they are neither rendered nor, as nothing unseen is, moved."""
        if left_out is None:
            yield
            return
        logits = self.gaussians.values[:, LOGIT_OPACITY]
        before = logits.copy()
        np.copyto(logits, NOWHERE, where=left_out)
        try:
            yield
        finally:
            np.copyto(logits, before, where=left_out)

    def bound_log_scales(self, largest: float) -> None:
        log_scales = self.gaussians.values[:, LOG_SCALE:QUATERNION]
        np.minimum(log_scales, np.float32(largest), out=log_scales)

    def lent(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()


make = CpuBackend
