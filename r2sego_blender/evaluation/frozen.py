"""Scores of an asset on frozen views, as the original 3DGS code computes them.

Every pixel of every view counts: no mask, no crop, no correction by what the view shows. What such a correction of
colours would change is told beside them, where photographs differ in exposure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..captures.capture import Capture
from ..core.cameras import Camera
from ..core.errors import CaptureError
from ..core.images import to_uint8
from ..core.progress import SILENT, Progress
from ..splats.colour_correction import colour_corrected
from ..splats.metrics import psnr, ssim
from .lpips.weights import find_lpips

if TYPE_CHECKING:
    from .lpips.network import Lpips


@dataclass(frozen=True)
class ViewScore:
    """One frozen view: PSNR in dB, SSIM and, where its weights are at hand, LPIPS-Alex; and where it was asked for,
    PSNR after the picture got the view's colours (``colour_correction``)."""

    name: str
    psnr: float
    ssim: float
    lpips_alex: float | None
    psnr_corrected: float | None = None


@dataclass(frozen=True)
class ArmScore:
    """The means over all frozen views of one arm, and each view's own scores.

    ``lpips_alex`` is None where LPIPS could not be computed; ``lpips_reason`` then says why. ``backend`` names what
    made the pictures, with its weights, where that runs in an environment of its own. ``psnr_corrected`` is None where
    it was not asked for.
    """

    psnr: float
    ssim: float
    lpips_alex: float | None
    views: tuple[ViewScore, ...]
    lpips_reason: str = ""
    backend: str = ""
    psnr_corrected: float | None = None


def score(
    asset_renderer: Callable[[Camera], np.ndarray],
    views: Sequence[Capture],
    lpips: Lpips | None = None,
    keep: Callable[[str, np.ndarray], None] | None = None,
    progress: Progress = SILENT,
    title: str = "Frozen views",
    corrected: bool = False,
) -> ArmScore:
    """Render every frozen view and compare it with the photograph.

    ``asset_renderer`` gives (H, W, 3) in [0, 1] at the camera's size. The rendering is
    clipped and rounded to 8 bits first, since the original ``metrics.py`` reads the PNGs
    that ``render.py`` wrote; so the figures can be had again from the report's pictures.
    ``lpips`` None looks for the weights (``find_lpips``). ``keep`` is given each view's
    name and its rounded rendering, float32. ``corrected`` asks for PSNR after colour
    correction, too. Raises CaptureError without any view, or when a rendering has another
    size than its view.
    """
    if not views:
        raise CaptureError("there are no frozen views", cure="Name a cameras.json with a 'frozen' list.")
    reason = ""
    if lpips is None:
        lpips, reason = find_lpips()
    scores, distances, after_correction = [], [], []
    for view in progress.track(views, title):
        truth = view.image()
        rendering = to_uint8(asset_renderer(view.camera)).astype(np.float32) / 255.0
        if rendering.shape != truth.shape:
            raise CaptureError(
                f"the rendering has shape {rendering.shape}, the frozen view {truth.shape}",
                where=view.image_path,
                cure="Render at the frozen camera's size.",
            )
        distance = None if lpips is None else lpips.distance(rendering, truth)
        distances += [distance] if distance is not None else []
        after = psnr(colour_corrected(rendering, truth), truth) if corrected else None
        after_correction += [after] if after is not None else []
        scores.append(ViewScore(view.name, psnr(rendering, truth), ssim(rendering, truth), distance, after))
        if keep is not None:
            keep(view.name, rendering)
    return ArmScore(
        psnr=float(np.mean([view.psnr for view in scores])),
        ssim=float(np.mean([view.ssim for view in scores])),
        lpips_alex=None if lpips is None else float(np.mean(distances)),
        views=tuple(scores),
        lpips_reason=reason,
        psnr_corrected=float(np.mean(after_correction)) if corrected else None,
    )
