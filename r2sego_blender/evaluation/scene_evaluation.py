"""Scoring a refined scene on its frozen views: its arms, and every round."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle import layout
from ..bundle.damage import require_as_made
from ..bundle.scene import Scene
from ..bundle.stale import require_present_frame
from ..captures.capture import Capture
from ..core.errors import R2SEgoError, SceneError
from ..core.progress import SILENT, Progress
from ..results.plan import parts_outdated
from . import generator_score, round_scores, scene_causes, view_influence
from .arm_scores import ScoredArms, arm_lines, asset_digests, not_scored_lines, score_arms
from .arms import ARMS, DEFAULT_ARMS, REFINED
from .cause_figures import report_causes
from .exposure.exposures import exposures_of
from .frozen_views import poses_lines, views_to_score
from .generator_score import score_generator
from .metrics_file import write_metrics
from .report_data import FrozenView, Rendering
from .round_scores import score_rounds
from .scene_causes import SceneCauses, split_by_cause
from .scene_report import write_scene_report
from .surfaces.figures import geometry_lines, region_psnr, unseen_told
from .surfaces.scene_surfaces import SceneSurfaces, surfaces_of
from .surfaces.surface_scores import ArmFigures, arm_figures, geometry_figures

_OF_BEFORE = (
    "`r2sego refine` would make the asset anew, since a setting or what it is made of has changed, or is missing: "
    "arms that are trained to compare with it have what is declared now"
)


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
    told = _OF_BEFORE if "asset" in parts_outdated(scene) else ""
    if told:
        progress.message(f"{scene.path}: {told}", "warning")
    views, poses = views_to_score(scene, frozen, distinct, progress)
    exposures = exposures_of(scene)
    scored = score_arms(scene, arms, views, exposures, progress)
    rounds = score_rounds(scene, views, exposures, progress)
    generator = score_generator(scene, views, exposures, progress)
    images = {arm: [pictures[view.name] for view in views] for arm, pictures in scored.renderings.items()}
    depths = scored.depths
    influence = view_influence.view_influence(scene, views, images, depths[REFINED], progress)
    surfaces = _surfaces(scene, frozen, views, progress)
    causes: SceneCauses | str = surfaces if isinstance(surfaces, str) else ""
    figures: dict[str, ArmFigures] = {}
    if not isinstance(surfaces, str):
        causes = split_by_cause(surfaces, views, images[REFINED], depths[REFINED])
        figures = {arm: arm_figures(surfaces, views, images[arm], depths[arm]) for arm in scored.scores}
        figures[REFINED] = figures[REFINED].with_whole(geometry_figures(scene, surfaces, progress))
    metrics = write_metrics(
        scene.made_folder(scene.report_folder.name) / scene.metrics_file.name,
        scored.scores,
        figures,
        rounds=round_scores.as_entries(rounds),
        generator=generator,
        generated_views=influence,
        causes=scene_causes.as_entry(causes),
        assets=asset_digests(scene, scored.scores, rounds=True),
        frozen_poses=poses,
        not_scored=scored.not_scored,
    )
    unseen = [] if isinstance(surfaces, str) else [~view.seen for view in surfaces.views]
    shown = _pictures(views, scored, figures, unseen)
    split = report_causes(causes, scored.scores[REFINED], shown)
    of_generator = generator_score.told(generator)
    write_scene_report(scene, scored.scores, shown, rounds, split, figures, of_generator, influence, poses, told)
    return metrics


def table(metrics: Mapping[str, Any]) -> str:
    """The scores as lines for a terminal."""
    told = metrics["arms"][REFINED]
    lines = [*arm_lines(metrics["arms"]), *round_scores.lines(metrics["rounds"]), *not_scored_lines(metrics)]
    lines += [f"mean over {len(told['views'])} frozen views", *poses_lines(metrics)]
    of_generator = generator_score.told(metrics.get("generator", {}))
    of_views = view_influence.told(metrics.get("generated_views", {}))
    lines += [*filter(None, [of_generator, of_views, unseen_told(told)]), *geometry_lines(told)]
    return "\n".join([*lines, "", *scene_causes.lines(metrics["causes"])])


def _surfaces(scene: Scene, frozen: Path, views: Sequence[Capture], progress: Progress) -> SceneSurfaces | str:
    """What the views look at, or why that cannot be told."""
    try:
        return surfaces_of(scene, frozen, views, progress)
    except R2SEgoError as error:
        return str(error)


def _pictures(
    views: Sequence[Capture], scored: ScoredArms, figures: Mapping[str, ArmFigures], unseen: Sequence[np.ndarray]
) -> tuple[FrozenView, ...]:
    by_name = {arm: {view.name: view for view in score.views} for arm, score in scored.scores.items()}

    def rendering(arm: str, name: str) -> Rendering:
        found = by_name[arm][name]
        of_view = figures[arm].views[name] if figures else {}
        regions = (region_psnr(of_view, kind) for kind in ("psnr_seen", "psnr_unseen"))
        return Rendering(arm, scored.renderings[arm][name], found.psnr, found.ssim, *regions)

    return tuple(
        FrozenView(
            view.name,
            view.image(),
            tuple(rendering(arm, view.name) for arm in scored.scores),
            unseen[index] if unseen else None,
        )
        for index, view in enumerate(views)
    )
