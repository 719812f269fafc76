"""What the library knows of a format of splat files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..asset import SplatAsset


@dataclass(frozen=True)
class SplatFormat:
    """A format; the file of this folder that reads and writes it calls it ``FORMAT``.

    ``suffixes`` choose it. ``menu`` has those that are offered where one is chosen, each with its
    label and what the file keeps, and ``rank`` is the format's place in lists. Its files begin with one
    of ``magic``, with anything if there is none. ``is_y_up`` tells the axes in the file from the world's,
    which are Z up; ``degree`` is the highest of the harmonics that it keeps. ``unread`` names what a file has
    of each Gaussian and no asset keeps.

    ``load`` returns the asset in the world frame, without Gaussians that ``asset.usable`` does not name;
    it raises AssetError naming a file that is missing, damaged or of another format. ``save`` writes
    one whole or not at all; it raises AssetError when the format cannot hold the asset, or the disk
    refuses. Both import libraries that Blender's Python lacks only when they are called.
    """

    suffixes: tuple[str, ...]
    menu: tuple[tuple[str, str, str], ...]
    rank: int
    magic: tuple[bytes, ...]
    load: Callable[[Path], SplatAsset]
    save: Callable[[Path, SplatAsset], None]
    is_y_up: bool = False
    degree: int = 3
    unread: Callable[[Path], Sequence[str]] | None = None
