"""Scoring a scene on frozen views: its arms, and every round.

Frozen views are read here alone, after the refinement; nothing of them flows back.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
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
from ..core.errors import MachineError, NativeError, R2SEgoError, SceneError
from ..core.progress import SILENT, Progress
from ..geometry.stereo.stereo import DEPTH
from ..splats.asset import SplatAsset
from ..splats.formats.ply import load_made
from . import generator_score, round_scores, scene_causes, view_influence
from .arms import ARMS, DEFAULT_ARMS, REFINED
from .cause_figures import report_causes
from .distinct_views import require_distinct, seen_in_training
from .exposed_rendering import as_exposed
from .external_arms.external_views import ExternalViews, external_views, why_not_set_up
from .frozen import ArmScore, score
from .generator_score import score_generator
from .metrics_file import write_metrics
from .report_data import FrozenView, Rendering
from .round_scores import LABEL_WIDTH, score_rounds
from .scene_causes import SceneCauses, split_by_cause
from .scene_report import write_scene_report
from .surfaces.figures import SEEN_BY, geometry_lines, region_psnr, unseen_told
from .surfaces.scene_surfaces import SceneSurfaces, surfaces_of
from .surfaces.surface_scores import ArmFigures, arm_figures, geometry_figures
from .trained_arms import train_arms


def evaluate_scene(
    scene: Scene,
    frozen: Path,
    progress: Progress = SILENT,
    arms: Collection[str] = DEFAULT_ARMS,
    distinct: bool = False,
) -> dict[str, Any]:
    """Score the scene's arms and rounds on ``frozen``, and split the refined asset's error by
    cause; writes the report and returns ``metrics.json``.

    ``frozen`` is a cameras.json, of which the frozen list alone is read, or a folder of
    held-out photographs, which are located against the captures. Of ``arms`` alone are trained and
    scored, and the refined one always; a method of others that is not set up here, or breaks, is told and not
    scored. Raises SceneError when the scene has not been refined, its asset is not as it was made, its world frame was
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
    not_scored = {arm: why for arm in arms if ARMS[arm].views and (why := why_not_set_up(arm))}
    asked = [arm for arm in arms if arm not in not_scored]
    train_arms(scene, progress, {*asked, *(ARMS[arm].base for arm in asked)})
    shown_by_others, broken = _external_views(scene, asked, views, progress)
    not_scored |= broken
    for arm, why in not_scored.items():
        progress.message(f"{ARMS[arm].label} is not scored: {why}", "warning")
    arms = [arm for arm in arms if arm not in not_scored]
    scores: dict[str, ArmScore] = {}
    renderings: dict[str, dict[str, np.ndarray]] = {}
    depths: dict[str, list[np.ndarray]] = {}
    captures = scene.read(CAPTURES)
    for arm in arms:
        source = ARMS[arm]
        pictures = renderings[arm] = {}
        found = depths.setdefault(arm, [])
        made = shown_by_others.get(arm)
        scored = score(
            made.at(views) if made else _renderer(load_made(scene.path / source.asset), captures, found),
            views,
            keep=pictures.__setitem__,
            progress=progress,
            title=f"Scoring {source.label}",
        )
        scores[arm] = replace(scored, backend=made.told if made else "")
    rounds = score_rounds(scene, views, progress)
    generator = score_generator(scene, views, progress)
    images = {arm: [pictures[view.name] for view in views] for arm, pictures in renderings.items()}
    influence = view_influence.view_influence(scene, views, images, depths[REFINED], progress)
    surfaces = _surfaces(scene, frozen, views, progress)
    causes: SceneCauses | str = surfaces if isinstance(surfaces, str) else ""
    figures: dict[str, ArmFigures] = {}
    if not isinstance(surfaces, str):
        causes = split_by_cause(surfaces, views, images[REFINED], depths[REFINED])
        figures = {arm: arm_figures(surfaces, views, images[arm], depths[arm]) for arm in arms}
        figures[REFINED] = figures[REFINED].with_whole(geometry_figures(scene, surfaces, progress))
    metrics = write_metrics(
        scene.made_folder(scene.report_folder.name) / scene.metrics_file.name,
        scores,
        figures,
        rounds=round_scores.as_entries(rounds),
        generator=generator,
        generated_views=influence,
        causes=scene_causes.as_entry(causes),
        assets=_scored(scene, arms),
        not_scored=not_scored,
    )
    unseen = [] if isinstance(surfaces, str) else [~view.seen for view in surfaces.views]
    shown = _pictures(views, scores, renderings, figures, unseen)
    split = report_causes(causes, scores[REFINED], shown)
    write_scene_report(scene, scores, shown, rounds, split, figures, generator_score.told(generator), influence)
    return metrics


def _external_views(
    scene: Scene, arms: Sequence[str], views: Sequence[Capture], progress: Progress
) -> tuple[dict[str, ExternalViews], dict[str, str]]:
    """What methods of others show, by arm, and of those that show nothing why."""
    shown: dict[str, ExternalViews] = {}
    broken: dict[str, str] = {}
    for arm in arms:
        if not ARMS[arm].views:
            continue
        try:
            shown[arm] = external_views(scene, arm, views, progress)
        except (MachineError, NativeError) as error:
            broken[arm] = str(error)
    return shown, broken


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
    told = metrics["arms"][REFINED]
    regions = SEEN_BY in told
    head = f"{'':<{LABEL_WIDTH}}{'PSNR dB':>9}{'SSIM':>8}{'LPIPS':>8}"
    lines = [head + (f"{'seen dB':>9}{'unseen dB':>11}" if regions else "")]
    for arm, source in ARMS.items():
        if arm not in metrics["arms"]:
            continue
        scored = metrics["arms"][arm]
        lpips = "n/a" if scored["lpips_alex"] is None else f"{scored['lpips_alex']:.3f}"
        line = f"{source.label:<{LABEL_WIDTH}}{_psnr(scored['psnr']):>9}{scored['ssim']:>8.3f}{lpips:>8}"
        seen, unseen = (_psnr(scored[kind]) if kind in scored else "-" for kind in ("psnr_seen", "psnr_unseen"))
        lines.append(line + (f"{seen:>9}{unseen:>11}" if regions else ""))
    lines += round_scores.lines(metrics["rounds"])
    lines += [f"{ARMS[arm].label} is not scored: {why}" for arm, why in metrics.get("not_scored", {}).items()]
    lines.append(f"mean over {len(told['views'])} frozen views")
    of_generator = generator_score.told(metrics.get("generator", {}))
    of_views = view_influence.told(metrics.get("generated_views", {}))
    lines += [*filter(None, [of_generator, of_views, unseen_told(told)]), *geometry_lines(told)]
    return "\n".join([*lines, "", *scene_causes.lines(metrics["causes"])])


def _psnr(value: float | None) -> str:
    return f"{float('inf') if value is None else value:.2f}"


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


def _surfaces(scene: Scene, frozen: Path, views: Sequence[Capture], progress: Progress) -> SceneSurfaces | str:
    """What the views look at, or why that cannot be told."""
    try:
        return surfaces_of(scene, frozen, views, progress)
    except R2SEgoError as error:
        return str(error)


def _pictures(
    views: Sequence[Capture],
    scores: Mapping[str, ArmScore],
    renderings: Mapping[str, Mapping[str, np.ndarray]],
    figures: Mapping[str, ArmFigures],
    unseen: Sequence[np.ndarray],
) -> tuple[FrozenView, ...]:
    by_name = {arm: {view.name: view for view in scored.views} for arm, scored in scores.items()}

    def rendering(arm: str, name: str) -> Rendering:
        found = by_name[arm][name]
        of_view = figures[arm].views[name] if figures else {}
        regions = (region_psnr(of_view, kind) for kind in ("psnr_seen", "psnr_unseen"))
        return Rendering(arm, renderings[arm][name], found.psnr, found.ssim, *regions)

    return tuple(
        FrozenView(
            view.name,
            view.image(),
            tuple(rendering(arm, view.name) for arm in scores),
            unseen[index] if unseen else None,
        )
        for index, view in enumerate(views)
    )
