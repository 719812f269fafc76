"""What each round's asset scores on the frozen views: whether a round made the scene better."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..core.errors import R2SEgoError
from ..core.json_files import rounded
from ..core.progress import SILENT, Progress
from ..splats.artifacts import ASSET, BACKDROP
from ..splats.asset import SplatAsset
from .exposure.exposures import Exposures
from .frozen import score

LABEL_WIDTH = 20
"""Of the column of names, of arms and of rounds alike."""


@dataclass(frozen=True)
class RoundScore:
    """One round's asset before its backdrop, on the frozen views.

    ``round`` counts from 0. Of a round that could not be scored the scores are None and
    ``missing`` says why; ``lpips_alex`` is None too where its weights are not at hand.
    """

    round: int
    psnr: float | None
    ssim: float | None
    lpips_alex: float | None = None
    missing: str = ""


def score_rounds(
    scene: Scene, views: Sequence[Capture], exposures: Exposures, progress: Progress = SILENT
) -> tuple[RoundScore, ...]:
    """Score ``rounds/l/asset.ply`` of every declared round, in order.

    Each asset is put before the scene's backdrop, as the refined asset is. A round whose
    asset is missing or damaged is in the list, and says so.
    """
    rounds = range(scene.declaration.settings.rounds)
    try:
        backdrop = scene.read(BACKDROP)
    except R2SEgoError as error:
        missing = f"{BACKDROP.name}: {error.what}"
        return tuple(RoundScore(index, None, None, missing=missing) for index in rounds)
    return tuple(_score(scene, index, backdrop, views, exposures, progress) for index in rounds)


def below(rounds: Sequence[RoundScore]) -> tuple[str, ...]:
    """A line for each round: "" or "0.21 dB below round 0", its PSNR against that of the last
    round before it that has one."""
    lines: list[str] = []
    before: tuple[float, int] = -math.inf, 0  # psnr and number of the last round that has one
    for one in rounds:
        loss_db = 0.0 if one.psnr is None else before[0] - one.psnr
        lines.append(f"{loss_db:.2f} dB below round {before[1]}" if loss_db >= 0.005 else "")
        before = before if one.psnr is None else (one.psnr, one.round)
    return tuple(lines)


def as_entries(rounds: Sequence[RoundScore]) -> list[dict[str, Any]]:
    """The rounds as ``metrics.json`` has them: a round that falls back says so as ``mark``."""
    entries = []
    for one, mark in zip(rounds, below(rounds), strict=True):
        entry: dict[str, Any] = {"round": one.round, "psnr": rounded(one.psnr), "ssim": rounded(one.ssim)}
        if one.lpips_alex is not None:
            entry["lpips_alex"] = rounded(one.lpips_alex)
        entry |= {"mark": mark} if mark else {}
        entry |= {"missing": one.missing} if one.missing else {}
        entries.append(entry)
    return entries


def lines(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """The ``rounds`` of ``metrics.json`` as lines for a terminal, in the columns of the arms."""
    text = []
    for entry in entries:
        name = f"round {entry['round']}"
        if "missing" in entry:
            text.append(f"{name:<{LABEL_WIDTH}}not scored: {entry['missing']}")
            continue
        psnr = float("inf") if entry["psnr"] is None else entry["psnr"]
        text.append(f"{name:<{LABEL_WIDTH}}{psnr:>9.2f}{entry['ssim']:>8.3f}  {entry.get('mark', '')}".rstrip())
    return text


def _score(
    scene: Scene, index: int, backdrop: SplatAsset, views: Sequence[Capture], exposures: Exposures, progress: Progress
) -> RoundScore:
    made = ASSET.of_round(index)
    try:
        asset = scene.read(made)
    except R2SEgoError as error:
        return RoundScore(index, None, None, missing=f"{made.name}: {error.what}")
    whole = asset.concatenated(backdrop.with_degree(asset.degree))
    exposed = exposures.renderer(whole)
    arm = score(lambda camera: exposed(camera).colour, views, progress=progress, title=f"Scoring round {index}")
    return RoundScore(index, arm.psnr, arm.ssim, arm.lpips_alex)
