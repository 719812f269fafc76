"""The strongest baseline of a scene: its observed points at this project's rates, without rounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.store import CAPTURES
from r2sego_blender.evaluation.exposed_rendering import as_exposed
from r2sego_blender.evaluation.frozen import score
from r2sego_blender.evaluation.scene_evaluation import frozen_views
from r2sego_blender.geometry.stereo.observed_geometry import OBSERVED
from r2sego_blender.refine.visual_asset import vanilla_asset
from r2sego_blender.splats.training.observations import Observation


def strongest_baseline(scene: Scene, frozen: Path) -> tuple[float, float]:
    """PSNR and SSIM of the observed points trained at this project's rates, without rounds, at the ``frozen`` views."""
    h = scene.declaration.settings
    captures, observed = scene.read(CAPTURES), scene.read(OBSERVED)
    seen = [Observation(capture.camera, capture.image()) for capture in captures]
    steps, rng = h.rounds * h.training.steps_per_round, np.random.default_rng([h.seed, 1])
    asset = vanilla_asset(observed.points, observed.colours, seen, steps, h.training, rng)
    exposed = as_exposed(asset, captures)
    scored = score(lambda camera: exposed(camera).colour, frozen_views(scene, frozen))
    return round(scored.psnr, 3), round(scored.ssim, 4)
