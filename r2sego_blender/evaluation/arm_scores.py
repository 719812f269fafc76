"""The arms of a scene, trained where they are not there yet, and scored on its frozen views."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..core.cameras import Camera
from ..core.errors import MachineError, NativeError
from ..core.progress import SILENT, Progress
from ..splats.asset import SplatAsset
from ..splats.formats.ply import load_made
from .arms import ARMS
from .exposure.exposures import Exposures
from .external_arms.external_views import ExternalViews, external_views, why_not_set_up
from .frozen import ArmScore, score
from .round_scores import LABEL_WIDTH
from .trained_arms import train_arms


@dataclass(frozen=True)
class ScoredArms:
    """The scores of each arm, in the order of ``ARMS``, and what it shows of the frozen views.

    ``renderings`` are (H, W, 3) float32 in [0, 1] by arm and view; ``depths`` those of the views in their order,
    (H, W) planar metres, none where an arm shows pictures alone. ``not_scored`` says why an arm was left out.
    """

    scores: Mapping[str, ArmScore]
    renderings: Mapping[str, Mapping[str, np.ndarray]]
    depths: Mapping[str, Sequence[np.ndarray]]
    not_scored: Mapping[str, str]


def score_arms(
    scene: Scene, arms: Sequence[str], views: Sequence[Capture], exposures: Exposures, progress: Progress = SILENT
) -> ScoredArms:
    """Train those of ``arms`` that are not there, and score all of them; one that cannot be run is told."""
    not_scored = {arm: why for arm in arms if ARMS[arm].views and (why := why_not_set_up(arm))}
    asked = [arm for arm in arms if arm not in not_scored]
    train_arms(scene, progress, {*asked, *(ARMS[arm].base for arm in asked)})
    shown_by_others, broken = _external_views(scene, asked, views, exposures, progress)
    not_scored |= broken
    for arm, why in not_scored.items():
        progress.message(f"{ARMS[arm].label} is not scored: {why}", "warning")
    scores: dict[str, ArmScore] = {}
    renderings: dict[str, dict[str, np.ndarray]] = {}
    depths: dict[str, list[np.ndarray]] = {}
    for arm in arms:
        if arm in not_scored:
            continue
        source = ARMS[arm]
        pictures = renderings[arm] = {}
        found = depths.setdefault(arm, [])
        made = shown_by_others.get(arm)
        scored = score(
            made.at(views) if made else _renderer(load_made(scene.path / source.asset), exposures, found),
            views,
            keep=pictures.__setitem__,
            progress=progress,
            title=f"Scoring {source.label}",
            corrected=exposures.differ,
        )
        scores[arm] = replace(scored, backend=made.told if made else "")
    return ScoredArms(scores, renderings, depths, not_scored)


def asset_digests(scene: Scene, arms: Iterable[str], rounds: bool = False) -> dict[str, str]:
    """The arms' assets, and those of all rounds, as they are now: what changes later is not what was scored."""
    count = scene.declaration.settings.rounds if rounds else 0
    names = (*(ARMS[arm].asset for arm in arms), *(of_round(index, "asset.ply") for index in range(count)))
    outputs = scene.outputs()
    return {name: outputs[name] for name in names if name in outputs}


def arm_lines(arms: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The arms of ``metrics.json`` as a table for a terminal."""
    regions = any("psnr_seen" in scored for scored in arms.values())
    corrected = any("psnr_corrected" in scored for scored in arms.values())
    head = f"{'':<{LABEL_WIDTH}}{'PSNR dB':>9}{'SSIM':>8}{'LPIPS':>8}"
    lines = [head + (f"{'cc dB':>8}" if corrected else "") + (f"{'seen dB':>9}{'unseen dB':>11}" if regions else "")]
    for arm, source in ARMS.items():
        if arm not in arms:
            continue
        scored = arms[arm]
        lpips = "n/a" if scored["lpips_alex"] is None else f"{scored['lpips_alex']:.3f}"
        line = f"{source.label:<{LABEL_WIDTH}}{_psnr(scored['psnr']):>9}{scored['ssim']:>8.3f}{lpips:>8}"
        if corrected:
            line += f"{_psnr(scored['psnr_corrected']) if 'psnr_corrected' in scored else '-':>8}"
        seen, unseen = (_psnr(scored[kind]) if kind in scored else "-" for kind in ("psnr_seen", "psnr_unseen"))
        lines.append(line + (f"{seen:>9}{unseen:>11}" if regions else ""))
    return lines


def not_scored_lines(metrics: Mapping[str, Any]) -> list[str]:
    """The arms of ``metrics.json`` that were not scored, and why."""
    return [f"{ARMS[arm].label} is not scored: {why}" for arm, why in metrics.get("not_scored", {}).items()]


def _psnr(value: float | None) -> str:
    return f"{float('inf') if value is None else value:.2f}"


def _external_views(
    scene: Scene, arms: Sequence[str], views: Sequence[Capture], exposures: Exposures, progress: Progress
) -> tuple[dict[str, ExternalViews], dict[str, str]]:
    """What methods of others show, by arm, and of those that show nothing why."""
    shown: dict[str, ExternalViews] = {}
    broken: dict[str, str] = {}
    for arm in arms:
        if not ARMS[arm].views:
            continue
        try:
            shown[arm] = external_views(scene, arm, views, exposures, progress)
        except (MachineError, NativeError) as error:
            broken[arm] = str(error)
    return shown, broken


def _renderer(asset: SplatAsset, exposures: Exposures, depths: list[np.ndarray]) -> Callable[[Camera], np.ndarray]:
    """Renders the asset's colour as the captures' camera exposes it; its depth (H, W) is appended to ``depths``."""
    exposed = exposures.renderer(asset)

    def colour(camera: Camera) -> np.ndarray:
        rendering = exposed(camera)
        depths.append(rendering.depth)
        return rendering.colour

    return colour
