"""Scoring a scene on frozen views: initial asset, vanilla 3DGS and refined asset.

Frozen views are read here alone, after the refinement; nothing of them flows back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..captures.capture import Capture
from ..captures.frozen import load_frozen_views
from ..captures.locating import locate_views
from ..captures.sparse import SparsePoints
from ..captures.store import load_captures
from ..errors import SceneError
from ..geometry.observed import ObservedGeometry
from ..geometry.stereo import DepthMap
from ..progress import SILENT, Progress
from ..scene import Scene
from ..settings import VANILLA_3DGS
from ..splats.observations import Observation
from ..splats.ply import load_ply, save_ply
from ..splats.rasterizer import render
from ..steps import CAPTURES, DEPTH, OBSERVED, SPARSE
from ..visual_asset import vanilla_asset
from .arms import ARMS, VANILLA_ASSET
from .frozen import ArmScore, score
from .metrics_file import write_metrics
from .report_data import FrozenView, Rendering
from .scene_report import write_scene_report


def evaluate_scene(scene: Scene, frozen: Path, progress: Progress = SILENT) -> dict[str, Any]:
    """Score the scene's arms on ``frozen``; writes the report and returns ``metrics.json``.

    ``frozen`` is a cameras.json, of which the frozen list alone is read, or a folder of
    held-out photographs, which are located against the captures. Raises SceneError when
    the scene has not been refined.
    """
    if not scene.asset_file.is_file():
        raise SceneError(
            "the scene has not been refined",
            where=scene.path,
            cure=f"Run `r2sego refine {scene.path}` first.",
        )  # fmt: skip
    views = frozen_views(scene, frozen, progress)
    train_vanilla(scene, progress)
    scores: dict[str, ArmScore] = {}
    renderings: dict[str, dict[str, np.ndarray]] = {}
    for arm, source in ARMS.items():
        asset = load_ply(scene.path / source.asset)
        pictures = renderings[arm] = {}
        scores[arm] = score(
            lambda camera, asset=asset: render(asset, camera).colour, views,
            keep=pictures.__setitem__, progress=progress, title=f"Scoring {source.label}",
        )  # fmt: skip
    metrics = write_metrics(scene.report_folder / "metrics.json", scores)
    write_scene_report(scene, scores, _pictures(views, scores, renderings))
    return metrics


def frozen_views(scene: Scene, frozen: Path, progress: Progress = SILENT) -> tuple[Capture, ...]:
    """The frozen views in the world frame."""
    if frozen.is_dir():
        captures = load_captures(scene.captures_folder)
        maps = [DepthMap.load(scene.path / DEPTH / f"{capture.name}.npz") for capture in captures]
        h = scene.declaration.settings
        depths = [np.where(m.reliable(h.stereo), m.depth, 0.0) for m in maps]
        sparse = SparsePoints.load(scene.path / SPARSE)
        return locate_views(
            frozen, captures, sparse, h.captures, depths=depths, seed=h.seed, progress=progress
        )
    world_from_capture = np.array(scene.declaration.world_from_capture)
    return tuple(view.transformed(world_from_capture) for view in load_frozen_views(frozen))


def train_vanilla(scene: Scene, progress: Progress = SILENT) -> None:
    """The baseline from the same observed points, captures and total number of steps.

    Rates, densification and resolution are the original 3DGS'; the budget is the scene's.
    """
    h = scene.declaration.settings
    steps = h.rounds * h.training.steps_per_round
    original = dataclasses.replace(h.training, **VANILLA_3DGS)

    def compute(file: Path) -> None:
        observed = ObservedGeometry.load(scene.path / OBSERVED)
        captures = [Observation(c.camera, c.image()) for c in load_captures(scene.captures_folder)]
        rng = np.random.default_rng([h.seed, 1])
        save_ply(
            file,
            vanilla_asset(observed.points, observed.colours, captures, steps, original, rng, progress),
        )

    scene.step(VANILLA_ASSET, compute, inputs=[CAPTURES, OBSERVED], parameters=[original, steps, h.seed])


def table(metrics: Mapping[str, Any]) -> str:
    """The arms' scores as lines for a terminal."""
    lines = [f"{'':<16}{'PSNR dB':>9}{'SSIM':>8}{'LPIPS':>8}"]
    for arm, source in ARMS.items():
        scored = metrics["arms"][arm]
        lpips = "n/a" if scored["lpips_alex"] is None else f"{scored['lpips_alex']:.3f}"
        lines.append(f"{source.label:<16}{scored['psnr']:>9.2f}{scored['ssim']:>8.3f}{lpips:>8}")
    count = len(metrics["arms"]["refined"]["views"])
    lines.append(f"mean over {count} frozen views")
    return "\n".join(lines)


def _pictures(
    views: Sequence[Capture],
    scores: Mapping[str, ArmScore],
    renderings: Mapping[str, Mapping[str, np.ndarray]],
) -> tuple[FrozenView, ...]:
    by_name = {arm: {view.name: view for view in scored.views} for arm, scored in scores.items()}
    return tuple(
        FrozenView(
            view.name,
            view.image(),
            tuple(
                Rendering(arm, renderings[arm][view.name], found[view.name].psnr, found[view.name].ssim)
                for arm, found in by_name.items()
            ),
        )
        for view in views
    )
