"""The visual assets a bundle holds, loaded as they are shown."""

from __future__ import annotations

from ..bundle.asset_stages import Stage
from .asset import SplatAsset
from .formats.ply import load_made


def load_stage(stage: Stage) -> SplatAsset:
    """A bundle's asset at a stage, with the backdrop behind it. Raises AssetError when a file is damaged."""
    asset = load_made(stage.file)
    if stage.backdrop is None:
        return asset
    return asset.concatenated(load_made(stage.backdrop).with_degree(asset.degree))
