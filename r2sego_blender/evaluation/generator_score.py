"""What the generator itself makes of the frozen views: what its views could teach an asset at most, or nearly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..core.json_files import rounded
from ..core.progress import SILENT, Progress
from .blended_captures import blended_captures
from .exposure.exposures import Exposures
from .frozen import score

_EMBEDDED = "blending"


def score_generator(
    scene: Scene, views: Sequence[Capture], exposures: Exposures, progress: Progress = SILENT
) -> dict[str, Any]:
    """``psnr`` and ``ssim`` of the embedded generator's frames at ``views``, of the captures and the last proxy.

    They are exposed and scored as an asset's pictures are. Empty where another generator made the scene's views, for
    a clip of a model for each view costs too much, and where the proxy cannot be read.
    """
    if scene.declaration.settings.generation.generator != _EMBEDDED or (blend := blended_captures(scene)) is None:
        return {}
    scored = score(
        lambda camera: exposures.exposed(blend(camera).image, camera),
        views,
        progress=progress,
        title="Scoring the generator",
    )
    return {"psnr": rounded(scored.psnr), "ssim": rounded(scored.ssim)}


def told(entry: Mapping[str, Any]) -> str:
    """The entry of ``metrics.json`` as a sentence; "" where there is none."""
    if entry.get("psnr") is None:
        return ""
    return f"the generator itself makes {entry['psnr']:.2f} dB, SSIM {entry['ssim']:.3f} of these views"
