"""Methods of others alone, scored on a scene that need not be refined: what more captures are worth to them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from ..bundle.figures import BASELINE_METRICS, BASELINES
from ..bundle.scene import Scene
from ..core.errors import SettingsError
from ..core.progress import SILENT, Progress
from ..geometry.stereo.observed_geometry import OBSERVED
from .arm_scores import arm_lines, asset_digests, not_scored_lines, score_arms
from .arms import ARMS, DEFAULT_ARMS
from .exposure.exposures import exposures_of
from .frozen_views import poses_lines, views_to_score
from .metrics_file import write_metrics

DEFAULT_BASELINES = tuple(arm for arm in DEFAULT_ARMS if arm in BASELINES)


def evaluate_baselines(
    scene: Scene,
    frozen: Path,
    progress: Progress = SILENT,
    arms: Collection[str] = DEFAULT_BASELINES,
    distinct: bool = False,
) -> dict[str, Any]:
    """Train ``arms``, methods of others, from the scene's observed points, and score them; writes and returns
    ``report/baselines.json``, of the kind of ``metrics.json``.

    The refinement is begun until the points are observed, and no further; an evaluation that was made before stays as
    it is. ``frozen`` and ``distinct`` are as for ``evaluate_scene``. Raises SettingsError for an arm that takes a
    refinement.
    """
    if of_refinement := [arm for arm in arms if arm not in BASELINES]:
        cure = f"Give some of: {', '.join(BASELINES)}."
        raise SettingsError(f"{', '.join(of_refinement)} takes a refinement", where="arms", cure=cure)
    from ..pipeline import refine  # it takes seconds

    with scene.locked():
        refine(scene, progress, until=OBSERVED.name)
        views, poses = views_to_score(scene, frozen, distinct, progress)
        scored = score_arms(scene, tuple(arm for arm in ARMS if arm in arms), views, exposures_of(scene), progress)
        return write_metrics(
            scene.made_folder(scene.report_folder.name) / Path(BASELINE_METRICS.name).name,
            scored.scores,
            assets=asset_digests(scene, scored.scores),
            frozen_poses=poses,
            not_scored=scored.not_scored,
        )


def table(metrics: Mapping[str, Any]) -> str:
    """The scores as lines for a terminal."""
    views = {len(scored["views"]) for scored in metrics["arms"].values()}
    told = [f"mean over {count} frozen views" for count in views]
    return "\n".join([*arm_lines(metrics["arms"]), *not_scored_lines(metrics), *told, *poses_lines(metrics)])
