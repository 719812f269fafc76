"""What cameras see of an asset while it is trained, shown now and then."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from ...core.images import resize
from ...core.progress import Progress
from ..kernels.packing import PackedGaussians
from ..rendering.rasterizer import Rasterizer
from .observations import Observation
from .training import Watch

_WIDTH_PX = 320


def shown_from(observations: Sequence[Observation], title: str, progress: Progress) -> Watch:
    """A ``watch`` of ``train`` that shows the Gaussians as the observations see them, one after the other.

    Training goes on as without it, to the bit.
    """
    rasterizer, turns = Rasterizer(), itertools.cycle(observations)

    def picture(gaussians: PackedGaussians) -> np.ndarray:
        observation = next(turns)
        camera = observation.camera.scaled(min(1.0, _WIDTH_PX / observation.camera.width))
        behind = observation.background
        rasterizer.forward(
            gaussians, camera, (0.0, 0.0, 0.0) if behind is None else resize(behind, camera.width, camera.height)
        )
        return np.clip(rasterizer.rendering().colour, 0.0, 1.0)

    def watch(step: int, gaussians: Callable[[], PackedGaussians]) -> bool:
        progress.picture(title, lambda: picture(gaussians()))
        return False

    return watch
