"""Scoring a scene on frozen views: its arms, and every round.

Frozen views are read here alone, after the refinement; nothing of them flows back.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle import layout
from ..bundle.damage import require_as_made
from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.capture import Capture, DecodedCapture
from ..captures.frozen import load_frozen_views
from ..captures.solving.locating import locate_views
from ..captures.sparse_points import SPARSE
from ..captures.store import CAPTURES
from ..core.cameras import Camera
from ..core.errors import R2SEgoError, SceneError
from ..core.progress import SILENT, Progress
from ..geometry.stereo.stereo import DEPTH
from ..splats.asset import SplatAsset
from ..splats.formats.ply import load_made
from . import round_scores, scene_causes
from .arms import ARMS, REFINED
from .cause_figures import report_causes
from .distinct_views import require_distinct, seen_in_training
from .exposed_rendering import as_exposed
from .frozen import ArmScore, score
from .metrics_file import write_metrics
from .report_data import FrozenView, Rendering
from .round_scores import LABEL_WIDTH, score_rounds
from .scene_causes import SceneCauses, split_by_cause
from .scene_report import write_scene_report
from .trained_arms import train_arms


def evaluate_scene(
    scene: Scene, frozen: Path, progress: Progress = SILENT, arms: Collection[str] = tuple(ARMS), distinct: bool = False
) -> dict[str, Any]:
    """Score the scene's arms and rounds on ``frozen``, and split the refined asset's error by
    cause; writes the report and returns ``metrics.json``.

    ``frozen`` is a cameras.json, of which the frozen list alone is read, or a folder of
    held-out photographs, which are located against the captures. Of ``arms`` alone are trained and
    scored, and the refined one always. Raises SceneError when
    the scene has not been refined, its asset is not as it was made, its world frame was
    corrected since, or while another process or thread writes to it, and where views are to be
    ``distinct`` EvaluationError for one that was trained on (``require_distinct``).
    """
    with scene.locked():
        chosen = tuple(arm for arm in ARMS if arm in (*arms, REFINED))
        return _evaluated(scene, frozen, progress, chosen, distinct)


def _evaluated(scene: Scene, frozen: Path, progress: Progress, arms: Sequence[str], distinct: bool) -> dict[str, Any]:
    if not scene.asset_file.is_file():
        raise SceneError(
            "the scene has not been refined", where=scene.path, cure=f"Run `r2sego refine {scene.path}` first."
        )
    require_present_frame(scene, [layout.REFINED_ASSET], "scored")
    require_as_made(scene, layout.REFINED_ASSET)
    views = tuple(map(DecodedCapture.of, frozen_views(scene, frozen, progress)))  # for all arms and rounds
    if distinct:
        require_distinct(scene, views)
    if seen := seen_in_training(scene, views):
        progress.message(
            f"{', '.join(seen)}: taken from where a capture was; scores of what was trained on say little", "warning"
        )
    train_arms(scene, progress, arms)
    scores: dict[str, ArmScore] = {}
    renderings: dict[str, dict[str, np.ndarray]] = {}
    refined_depths: list[np.ndarray] = []
    captures = scene.read(CAPTURES)
    for arm in arms:
        source = ARMS[arm]
        pictures = renderings[arm] = {}
        asset = load_made(scene.path / source.asset)
        scores[arm] = score(
            _renderer(asset, captures, refined_depths if arm == REFINED else []),
            views,
            keep=pictures.__setitem__,
            progress=progress,
            title=f"Scoring {source.label}",
        )
    rounds = score_rounds(scene, views, progress)
    causes = _causes(scene, frozen, views, renderings[REFINED], refined_depths, progress)
    metrics = write_metrics(
        scene.made_folder(scene.report_folder.name) / scene.metrics_file.name,
        scores,
        rounds=round_scores.as_entries(rounds),
        causes=scene_causes.as_entry(causes),
        assets=_scored(scene, arms),
    )
    shown = _pictures(views, scores, renderings)
    split = report_causes(causes, scores[REFINED], shown)
    write_scene_report(scene, scores, shown, rounds, split)
    return metrics


def frozen_views(scene: Scene, frozen: Path, progress: Progress = SILENT) -> tuple[Capture, ...]:
    """The frozen views in the world frame."""
    if frozen.is_dir():
        captures = scene.read(CAPTURES)
        maps = scene.read(DEPTH).of(captures)
        h = scene.declaration.settings
        depths = [np.where(m.reliable(h.stereo), m.depth, 0.0) for m in maps]
        sparse = scene.read(SPARSE)
        return locate_views(frozen, captures, sparse, h.captures, depths=depths, seed=h.seed, progress=progress)
    world_from_capture = np.array(scene.declaration.world_from_capture)
    return tuple(
        view.transformed(world_from_capture) for view in load_frozen_views(frozen, captures=scene.read(CAPTURES))
    )


def table(metrics: Mapping[str, Any]) -> str:
    """The arms' scores as lines for a terminal."""
    lines = [f"{'':<{LABEL_WIDTH}}{'PSNR dB':>9}{'SSIM':>8}{'LPIPS':>8}"]
    for arm, source in ARMS.items():
        if arm not in metrics["arms"]:
            continue
        scored = metrics["arms"][arm]
        lpips = "n/a" if scored["lpips_alex"] is None else f"{scored['lpips_alex']:.3f}"
        psnr = float("inf") if scored["psnr"] is None else scored["psnr"]
        lines.append(f"{source.label:<{LABEL_WIDTH}}{psnr:>9.2f}{scored['ssim']:>8.3f}{lpips:>8}")
    lines += round_scores.lines(metrics["rounds"])
    count = len(metrics["arms"][REFINED]["views"])
    lines += [f"mean over {count} frozen views", "", *scene_causes.lines(metrics["causes"])]
    return "\n".join(lines)


def _scored(scene: Scene, arms: Sequence[str]) -> dict[str, str]:
    """The assets as they are now, by their digests: what changes later is not what was scored."""
    rounds = (of_round(index, "asset.ply") for index in range(scene.declaration.settings.rounds))
    outputs = scene.outputs()
    return {name: outputs[name] for name in (*(ARMS[arm].asset for arm in arms), *rounds) if name in outputs}


def _renderer(
    asset: SplatAsset, captures: Sequence[Capture], depths: list[np.ndarray]
) -> Callable[[Camera], np.ndarray]:
    """Renders the asset's colour as the captures' camera exposes it; its depth (H, W) is appended to ``depths``."""
    exposed = as_exposed(asset, captures)

    def colour(camera: Camera) -> np.ndarray:
        rendering = exposed(camera)
        depths.append(rendering.depth)
        return rendering.colour

    return colour


def _causes(
    scene: Scene,
    frozen: Path,
    views: Sequence[Capture],
    images: Mapping[str, np.ndarray],
    asset_depths: Sequence[np.ndarray],
    progress: Progress,
) -> SceneCauses | str:
    """The causes of the refined asset's error, or why they cannot be told."""
    try:
        ordered = [images[view.name] for view in views]
        return split_by_cause(scene, frozen, views, ordered, asset_depths, progress)
    except R2SEgoError as error:
        return str(error)


def _pictures(
    views: Sequence[Capture], scores: Mapping[str, ArmScore], renderings: Mapping[str, Mapping[str, np.ndarray]]
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
