"""What a target would add to those before it: a set of views is chosen, not each view by itself.

The score ``u g`` of Eq. 2 is of a candidate alone, so those that look at the same gap all rank high. Here the deficit
is what neither the asset nor a target before it shows: ``u g`` times the share of the missing surface that is left.
The first target is that of Eq. 2. Such gains only fall as targets are chosen, and taking the greatest each time is
within 1 - 1/e of the best set (Nemhauser, Wolsey and Fisher, 1978).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..config.settings import SelectionSettings
from ..core.cameras import Camera
from ..splats.asset import SplatAsset
from ..splats.kernels.projection import DILATION_PX2
from .references import visible
from .scoring.deficit import AlphaRenderer

_SIDE_PX = 80
_COARSER = 2.0  # times as far off a target shows a surface too coarsely to stand for a nearer view of it


class MissingSurface:
    """Points of the proxy where each candidate's pixels are missing in the asset, one a pixel of a small image."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        asset: SplatAsset,
        depth_of: Callable[[Camera], np.ndarray],
        settings: SelectionSettings,
    ) -> None:
        """``cameras`` are the M candidates'; ``depth_of`` renders the proxy's planar depth (H, W), 0 where none is."""
        self._cameras = [camera.fitted(_SIDE_PX) for camera in cameras]
        self._alphas, self._depth_of, self._settings = AlphaRenderer(asset), depth_of, settings
        self._dilation_px2 = DILATION_PX2 * (self._cameras[0].width / cameras[0].width) ** 2 if cameras else 0.0
        self._known: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def missing(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """A candidate's points (P, 3) in the world frame, metres, and their planar depths (P,)."""
        return self._of(index)[:2]

    def shown(self, index: int, points: np.ndarray, depths: np.ndarray) -> np.ndarray:
        """(P,) bool: which points, at ``depths`` from the candidate that misses them, candidate ``index`` shows too."""
        camera = self._cameras[index]
        seen = visible(points, camera, self._of(index)[2], self._settings.overlap_tolerance)
        near: np.ndarray = camera.project(points)[1] <= _COARSER * depths
        return seen & near

    def _of(self, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if index not in self._known:
            camera = self._cameras[index]
            depth = self._depth_of(camera)
            alpha = self._alphas.alphas([camera], self._dilation_px2)[0]
            missing = (depth > 0.0) & (alpha < self._settings.alpha_threshold)
            self._known[index] = camera.unproject(depth)[missing], depth[missing], depth
        return self._known[index]


def by_marginal_gain(
    order: np.ndarray, score: np.ndarray, surface: MissingSurface, count: int
) -> tuple[np.ndarray, dict[int, float]]:
    """The candidates ``order`` (R,), so far best first by their ``score`` (M,), the first ``count`` chosen greedily.

    The others follow as they were. Beside it, of each that was chosen, the share of its missing surface that no one
    before it shows; 1 where none of its missing pixels has a surface. Of equals the first in ``order`` is taken.
    """
    left = {int(index): np.ones(len(surface.missing(int(index))[0]), bool) for index in order}
    share: dict[int, float] = dict.fromkeys(left, 1.0)
    chosen: dict[int, float] = {}
    while share and len(chosen) < count:
        best = max(share, key=lambda index: score[index] * share[index])
        chosen[best] = share.pop(best)
        for index in share:
            points, depths = surface.missing(index)
            rest = left[index]
            rest[rest] = ~surface.shown(best, points[rest], depths[rest])
            share[index] = float(rest.mean()) if len(rest) else 1.0
    return np.array([*chosen, *(index for index in order.tolist() if index not in chosen)], np.int64), chosen
