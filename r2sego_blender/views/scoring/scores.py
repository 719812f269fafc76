"""Asset deficit and geometry availability of a round's candidate views (the paper's Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...config.settings import SelectionSettings
from ...core.cameras import Camera
from ...core.progress import SILENT, Progress
from ...geometry.proxy.proxy import GeometryProxy
from ...geometry.visibility.face_sight import face_sight
from ...splats.asset import SplatAsset
from ...splats.kernels.projection import DILATION_PX2
from .availability import ValidityRenderer
from .deficit import AlphaRenderer

_VIEWS_AT_A_TIME = 8
"""Each has buffers of its own: enough for the threads, few enough for the memory."""


def support_scores(
    cameras: Sequence[Camera],
    asset: SplatAsset,
    proxy: GeometryProxy,
    settings: SelectionSettings,
    progress: Progress = SILENT,
    captures: Sequence[Camera] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Asset deficit u (M,) and geometry availability g (M,) of each camera, float64 in [0, 1].

    u is the share of pixels whose alpha is below its threshold, g the share whose validity
    reaches its own; g is 1 where the settings leave the geometry out. With ``captures`` only
    what these saw well enough is valid, else all that has support. At a scoring scale
    below 1 the same is asked of fewer pixels, at the full image's sharpness: a sample of
    its pixels, not a smaller image. The cameras share one lens. The same bits for any
    number of threads.
    """
    scale = settings.scoring_scale
    alphas = AlphaRenderer(asset)
    validities = None
    if settings.geometry == "proxy":
        sight = face_sight(proxy.vertices, proxy.faces, captures) if captures else None
        validities = ValidityRenderer(proxy, sight)
    deficit, availability = np.empty(len(cameras)), np.ones(len(cameras))
    with progress.task("Scoring candidates", len(cameras)) as task:
        for start in range(0, len(cameras), _VIEWS_AT_A_TIME):
            some = slice(start, start + _VIEWS_AT_A_TIME)
            views = [camera.scaled(scale) for camera in cameras[some]]
            deficit[some] = alphas.missing_shares(views, settings.alpha_threshold, DILATION_PX2 * scale**2)
            if validities is not None:
                availability[some] = validities.available_shares(views, settings.validity_threshold, scale)
            task.advance(len(views))
    return deficit, availability
