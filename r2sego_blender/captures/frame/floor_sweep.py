"""The height of a floor that shows no features: where photographs look alike when carried onto a level plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.images import resize
from ..capture import Capture
from ..matching.plane_sweep import GreyView, likeness_on_planes, textured_pixels

_WORKING_PX = 320
_MOST_VIEWS, _MOST_OTHERS = 24, 8  # photographs that ask, and that each of them is compared with
_DEEPEST_M = 2.5  # under the cameras
_STEP_M, _FINE_STEP_M = 0.02, 0.005
_ALIKE = 0.8  # correlation from which a patch lies on a plane
_LEAST_SHARE = 0.05  # of the patches compared on the floor, that are alike
_DISTINCT = 1.4  # times as many as on any other level plane
_ONE_PLANE_M = 0.15  # nearer planes are the same


@dataclass(frozen=True)
class SweptFloor:
    """A floor's ``height_m`` along up, and how many ``patches`` look alike on it."""

    height_m: float
    patches: int


def swept_floor(captures: Sequence[Capture], up: np.ndarray, highest_m: float) -> SweptFloor | None:
    """The floor under ``captures``, whose frame is in metres and whose direction ``up`` (3,) is known.

    Level planes from ``highest_m``, above which it cannot lie, downwards are tried. The one on which most patches
    look alike is the floor where it is far from any other, and not the top one, which something higher
    explains; else None. Deterministic.
    """
    chosen = np.unique(np.linspace(0, len(captures) - 1, min(len(captures), _MOST_VIEWS)).round().astype(int))
    views = [_grey(captures[index]) for index in chosen]
    centres = np.array([view.camera.centre for view in views])
    heights = np.arange(highest_m, float(np.median(centres @ up)) - _DEEPEST_M, -_STEP_M)
    if len(views) < 2 or len(heights) < 2:
        return None
    near = np.argsort(np.linalg.norm(centres[:, None] - centres[None], axis=2), axis=1, kind="stable")
    compared = [
        (view, [views[other] for other in near[i][1 : _MOST_OTHERS + 1]], textured_pixels(view))
        for i, view in enumerate(views)
    ]
    likeness = _likeness(compared, up, heights)
    alike = (likeness >= _ALIKE).sum(axis=1)
    best = int(np.argmax(alike))
    others = alike[np.abs(heights - heights[best]) > _ONE_PLANE_M]
    if best <= 1 or alike[best] < _DISTINCT * others.max(initial=0):
        return None
    if alike[best] < _LEAST_SHARE * max(int((likeness[best] > -1.0).sum()), 1):
        return None
    fine = heights[best] + np.arange(-_STEP_M, _STEP_M + 1e-9, _FINE_STEP_M)
    finely = _likeness(compared, up, fine)
    # A nearer plane hides more: the same patches must say which height is the best.
    everywhere = (finely > -1.0).all(axis=0)
    height_m = fine[np.argmax(np.maximum(finely[:, everywhere], _ALIKE).sum(axis=1))]
    return SweptFloor(float(height_m), int(alike[best]))


def _grey(capture: Capture) -> GreyView:
    camera = capture.camera.fitted(_WORKING_PX)
    return GreyView.of(resize(capture.image(), camera.width, camera.height), camera)


def _likeness(
    compared: Sequence[tuple[GreyView, Sequence[GreyView], np.ndarray]], up: np.ndarray, heights: np.ndarray
) -> np.ndarray:
    """(H, N) of the level planes at ``heights`` (H,) and all patches of all views, -2 where nothing is compared."""
    normals = np.broadcast_to(up, (len(heights), 3))
    found = [
        likeness_on_planes(view, others, pixels, normals, heights)[0]
        for view, others, pixels in compared
        if len(pixels)
    ]
    return np.concatenate(found, axis=1) if found else np.full((len(heights), 0), -2.0, np.float32)
