"""Files of splat assets that other programs read, brought back into our world (docs/splat_formats.md).

The formats are found: every file of this folder that has a ``FORMAT`` (see ``record``) is one.
"""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import numpy as np

from ...core.errors import AssetError
from ...core.printable import printable
from ...core.progress import SILENT, Progress
from ..asset import SplatAsset
from . import __path__
from .files import content
from .record import SplatFormat

_FILES = (importlib.import_module(f".{file.name}", __package__) for file in pkgutil.iter_modules(__path__))
FORMATS: tuple[SplatFormat, ...] = tuple(
    sorted((file.FORMAT for file in _FILES if hasattr(file, "FORMAT")), key=lambda found: found.rank)
)
"""The usual one first."""

SUFFIXES = tuple(suffix for found in FORMATS for suffix in found.suffixes)
"""What an asset's file may end in; the suffix chooses the format."""

MENU = tuple(choice for found in FORMATS for choice in found.menu)
"""Suffix, label and description of what is offered where a format is chosen, the usual first."""

_LISTED = 12
_MAGIC = tuple(magic for found in FORMATS for magic in found.magic)


def format_of(path: Path | str) -> SplatFormat:
    """The format of a file's suffix. Raises AssetError for a suffix of none."""
    suffix = Path(path).suffix
    for found in FORMATS:
        if suffix.lower() in found.suffixes:
            return found
    raise AssetError(f"'{suffix}' is no format of splats", where=path, cure=f"Use one of {', '.join(SUFFIXES)}.")


def load_asset(path: Path | str, progress: Progress = SILENT) -> SplatAsset:
    """The asset in a file of any format, in the world frame: Z up, metres.

    Gaussians with a value that is not finite, or beyond all bounds (``asset.usable``), are dropped.
    A ``.ply`` may be the compressed one of SuperSplat. Properties that no asset keeps are named in a
    warning. Raises AssetError naming the file when it is
    missing, damaged or of another format.
    """
    path = Path(path)
    found = format_of(path)
    if not found.magic and content(path, max(map(len, _MAGIC))).startswith(_MAGIC):
        raise AssetError(
            f"the file is not a {found.suffixes[0]} but another format", where=path, cure="Give it its own suffix."
        )
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # of values that are dropped
            asset = found.load(path)
        if found.unread is not None and (names := found.unread(path)):
            progress.message(f"{path}: not read: {', '.join(map(printable, names[:_LISTED]))}", "warning")
        return asset
    except AssetError as error:
        if error.where is not None:
            raise
        raise AssetError(error.what, where=path, cure="Copy or export it again.") from error


def save_asset(path: Path | str, asset: SplatAsset) -> None:
    """Write an asset of the world frame in the format of the file's suffix.

    The file appears whole or not at all. Gaussians with a value that is not finite are left
    out. Raises AssetError when the format cannot hold the asset, or the disk refuses.
    """
    path = Path(path)
    format_of(path).save(path, asset)
