"""Files of splat assets that other programs read, brought back into our world (docs/splat_formats.md)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ..asset import SplatAsset
from .compressed_ply import ELEMENTS, is_compressed, unpacked
from .files import publishing
from .ply import from_vertices, save_ply
from .ply_vertices import read_elements

SUFFIXES = (".ply", ".splat", ".spz", ".glb", ".gltf", ".usd", ".usda", ".usdc", ".usdz")
"""What an asset's file may end in; the suffix chooses the format."""


def load_asset(path: Path | str) -> SplatAsset:
    """The asset in a file of any format, in the world frame: Z up, metres.

    Gaussians with a value that is not finite are dropped. A ``.ply`` may be the compressed one
    of SuperSplat. Raises AssetError naming the file when it is missing, damaged or of another
    format.
    """
    path = Path(path)
    load, _ = _functions(path)
    with np.errstate(over="ignore", invalid="ignore"):  # of values that are dropped
        return load(path)


def save_asset(path: Path | str, asset: SplatAsset) -> None:
    """Write an asset of the world frame in the format of the file's suffix.

    The file appears whole or not at all. Gaussians with a value that is not finite are left
    out. Raises AssetError when the format cannot hold the asset, or the disk refuses.
    """
    path = Path(path)
    _, save = _functions(path)
    save(path, asset)


def _load_ply(path: Path) -> SplatAsset:
    elements = read_elements(path, ELEMENTS)
    return unpacked(elements, path) if is_compressed(elements) else from_vertices(elements["vertex"], path)


def _save_ply(path: Path, asset: SplatAsset) -> None:
    with publishing(path) as staging:
        save_ply(staging, asset.finite())


def _functions(
    path: Path,
) -> tuple[Callable[[Path], SplatAsset], Callable[[Path, SplatAsset], None]]:
    """Load and save of a format; its libraries are imported only when it is asked for."""
    match path.suffix.lower():
        case ".ply":
            return _load_ply, _save_ply
        case ".splat":
            from .splat import load_splat, save_splat

            return load_splat, save_splat
        case ".spz":
            from .spz import load_spz, save_spz

            return load_spz, save_spz
        case ".glb" | ".gltf":
            from .gltf import load_gltf, save_gltf

            return load_gltf, save_gltf
        case ".usd" | ".usda" | ".usdc" | ".usdz":
            from .usd import load_usd, save_usd

            return load_usd, save_usd
    raise AssetError(
        f"'{path.suffix}' is no format of splats", where=path, cure=f"Use one of {', '.join(SUFFIXES)}."
    )
