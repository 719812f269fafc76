"""The quantities in which the formats differ from an asset: axes, scales, opacities, rotations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import LARGEST_LOG_SCALE, SplatAsset

Y_UP_FROM_WORLD = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""(4, 4): right-handed, Y up, the world's y axis pointing away from the viewer (-z), as Blender exports."""

WORLD_FROM_Y_UP = Y_UP_FROM_WORLD.T

_LOG_SCALE_LIMITS = (-27.0, LARGEST_LOG_SCALE)
"""Linear scales from a picometre up: they keep a logarithm, and fit into float32."""

_OPACITY_LIMITS = (1e-12, 1.0 - 2.0**-25)
"""Opacities whose logits are finite; nothing in a picture tells them from 0 and 1."""


def in_world(asset: SplatAsset, world_from_file: np.ndarray, path: Path) -> SplatAsset:
    """The file's Gaussians moved to where they are finite in the world, the others dropped.

    Raises AssetError when none is, or the (4, 4) matrix is no similarity.
    """
    try:
        return asset.transformed(world_from_file).finite(path)
    except AssetError as error:
        if error.where:
            raise
        raise AssetError(
            "the splats stand under a transform that shears, mirrors or scales unevenly",
            where=path,
            cure="Apply the transform in the program that wrote the file.",
        ) from error


def linear_scales(asset: SplatAsset) -> np.ndarray:
    """(N, 3) float32 standard deviations, metres."""
    return np.exp(np.clip(asset.log_scales, *_LOG_SCALE_LIMITS))


def log_scales(scales: np.ndarray) -> np.ndarray:
    """(N, 3) logarithms of standard deviations; those below zero become NaN."""
    scales = np.asarray(scales, np.float64)
    thinnest = np.exp(_LOG_SCALE_LIMITS[0])
    return np.log(np.where(scales < 0.0, np.nan, np.maximum(scales, thinnest)))


def logits(opacities: np.ndarray) -> np.ndarray:
    """(N,) logits of opacities in [0, 1]."""
    opacities = np.clip(np.asarray(opacities, np.float64), *_OPACITY_LIMITS)
    return np.log(opacities / (1.0 - opacities))


def logits_of_bytes(alpha: np.ndarray) -> np.ndarray:
    """(N,) logits of opacities in 255ths; 0 and 255 mean the middle of what rounds to them."""
    return logits(np.clip(np.asarray(alpha, np.float64), 0.25, 254.75) / 255.0)


def to_bytes(values: np.ndarray) -> np.ndarray:
    """Rounded to uint8, saturating."""
    return np.clip(np.rint(values), 0.0, 255.0).astype(np.uint8)
