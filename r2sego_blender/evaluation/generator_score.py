"""What the generator itself makes of the frozen views: what its views could teach an asset at most, or nearly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..core.cameras import Camera
from ..core.errors import R2SEgoError
from ..core.json_files import rounded
from ..core.progress import SILENT, Progress
from ..generation.conditions.conditions import ZBufferRenderer
from ..generation.generators.blending import BlendingGenerator
from ..geometry.proxy.proxy import PROXY
from ..geometry.stereo.stereo import DEPTH
from ..refine.depths import proxy_depths, reliable_depths
from .exposed_rendering import exposed
from .frozen import score

_EMBEDDED = "blending"


def score_generator(scene: Scene, views: Sequence[Capture], progress: Progress = SILENT) -> dict[str, Any]:
    """``psnr`` and ``ssim`` of the embedded generator's frames at ``views``, of the captures and the last proxy.

    They are exposed and scored as an asset's pictures are. Empty where another generator made the scene's views, for
    a clip of a model for each view costs too much, and where the proxy cannot be read.
    """
    h = scene.declaration.settings
    rounds = scene.rounds_of_result()
    if h.generation.generator != _EMBEDDED or not rounds:
        return {}
    try:
        captures, proxy = scene.read(CAPTURES), scene.read(PROXY.of_round(rounds - 1))
        observed = reliable_depths(captures, scene.read(DEPTH), h.stereo)
        generator = BlendingGenerator(captures, proxy_depths(captures, proxy), h.generation, observed)
    except R2SEgoError:
        return {}
    renderer = ZBufferRenderer(proxy)

    def made(camera: Camera) -> np.ndarray:
        return exposed(generator.blend(renderer.condition(camera), seen=False).image, camera, captures)

    scored = score(made, views, progress=progress, title="Scoring the generator")
    return {"psnr": rounded(scored.psnr), "ssim": rounded(scored.ssim)}


def told(entry: Mapping[str, Any]) -> str:
    """The entry of ``metrics.json`` as a sentence; "" where there is none."""
    if entry.get("psnr") is None:
        return ""
    return f"the generator itself makes {entry['psnr']:.2f} dB, SSIM {entry['ssim']:.3f} of these views"
