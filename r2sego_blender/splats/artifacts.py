"""The visual assets of a bundle: the initial one, each round's, the backdrop, and the refined one."""

from __future__ import annotations

from pathlib import Path

from ..bundle import layout
from ..bundle.artifacts import Artifact
from ..bundle.asset_stages import Stage
from .asset import SplatAsset
from .formats.ply import load_made, save_ply


def _save(asset: SplatAsset, file: Path) -> None:
    save_ply(file, asset)


INITIAL_ASSET = Artifact(layout.INITIAL_ASSET, load_made, _save)
"""A_0."""

BACKDROP = Artifact(layout.BACKDROP, load_made, _save)
"""What stands behind every round's asset."""

ASSET = Artifact("asset.ply", load_made, _save)
"""A round's: ``ASSET.of_round(l)``."""

REFINED_ASSET = Artifact(layout.REFINED_ASSET, load_made, _save, editable=False)
"""A* before its backdrop."""


def load_stage(stage: Stage) -> SplatAsset:
    """The asset at a stage as it is shown: with the backdrop behind it."""
    asset = load_made(stage.file)
    if stage.backdrop is None:
        return asset
    return asset.concatenated(load_made(stage.backdrop).with_degree(asset.degree))


def asset_before(round_index: int) -> Artifact[SplatAsset]:
    """The asset that a round begins with."""
    return ASSET.of_round(round_index - 1) if round_index else INITIAL_ASSET
