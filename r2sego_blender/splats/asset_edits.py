"""What a person deleted from the asset: regions of space, kept in the bundle as ``asset_edits/``.

Regions and no list of Gaussians, so that an edit outlives a new refinement: it is applied
whenever the asset is published. NumPy alone: Blender lists the edits too.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..bundle import layout
from ..bundle.artifacts import Artifact
from ..bundle.scene import Scene
from ..core.errors import AssetError
from ..core.json_files import given_json, write_json
from .regions import Box, Region, region_of

_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


@dataclass(frozen=True)
class AssetEdit:
    """Regions that were deleted together, under one name."""

    name: str
    regions: tuple[Region, ...]

    def deletes(self, means: np.ndarray) -> np.ndarray:
        """(N,) bool: which of the centres (N, 3), metres, one of the regions holds."""
        deleted = np.zeros(len(means), bool)
        for region in self.regions:
            deleted |= region.holds(means)
        return deleted


def load_edits(folder: Path) -> tuple[AssetEdit, ...]:
    """The edits in a folder by name; none if it is not there. Raises AssetError when a file is damaged."""
    return tuple(_load(file) for file in sorted(folder.glob("[!.]*.json")))


def deleted_by(edits: Sequence[AssetEdit], means: np.ndarray) -> np.ndarray:
    """(N,) bool: which of the centres (N, 3), metres, one of the edits deletes."""
    deleted = np.zeros(len(means), bool)
    for edit in edits:
        deleted |= edit.deletes(means)
    return deleted


def next_name(bundle: Path) -> str:
    """The first free one of edit_001, edit_002 and on."""
    taken = {file.stem for file in (bundle / layout.ASSET_EDITS).glob("[!.]*.json")}
    return next(name for name in (f"edit_{i:03d}" for i in range(1, len(taken) + 2)) if name not in taken)


def not_yet_deleted(edits: Sequence[AssetEdit], regions: Sequence[Region]) -> tuple[Region, ...]:
    """The regions that none of the edits has. Raises AssetError when there are some, but none such."""
    told = {edit.name: [region.to_json() for region in edit.regions] for edit in edits}
    left = tuple(one for one in regions if not any(one.to_json() in known for known in told.values()))
    if regions and not left:
        name = next(name for name, known in told.items() if regions[0].to_json() in known)
        raise AssetError(
            "the same regions are deleted already", where=name, cure="Give others, or take that edit back."
        )
    return left


def save_edit(scene: Scene, edit: AssetEdit) -> Path:
    """Write an edit into the bundle, in place of one of that name. Raises AssetError for a bad name."""
    if not _NAME.fullmatch(edit.name):
        raise AssetError(f"'{edit.name}' is no name of an edit", where="--name", cure="Use letters, digits, - and _.")
    content = {"regions": [region.to_json() for region in edit.regions]}
    with scene.publishing(f"{layout.ASSET_EDITS}/{edit.name}.json") as staging:
        write_json(staging, content)
    return scene.path / layout.ASSET_EDITS / f"{edit.name}.json"


def edit_file(scene: Scene, name: str) -> Path:
    """Where the bundle keeps an edit. Raises AssetError when there is none of that name."""
    file = scene.path / layout.ASSET_EDITS / f"{name}.json"
    if not _NAME.fullmatch(name) or not file.is_file():
        names = ", ".join(edit.name for edit in scene.read(ASSET_EDITS)) or "none"
        raise AssetError(f"there is no edit '{name}'", where=scene.path, cure=f"There are: {names}.")
    return file


def move_edits(scene: Scene, similarity: np.ndarray) -> None:
    """Carry the edits into another world frame, (4, 4) similarity."""
    for edit in scene.read(ASSET_EDITS):
        save_edit(scene, AssetEdit(edit.name, tuple(one.transformed(similarity) for one in edit.regions)))


def load_region(file: Path, kind: str) -> Region:
    """The region of a kind in a JSON file; the file need not name the kind.

    Raises AssetError where it is none, and for a box that can hold nothing.
    """
    region = region_of({**_json(file), "kind": kind}, file)
    if isinstance(region, Box) and region.half_extents.min() < 0.0:
        raise AssetError("half_extents are negative", where=file, cure="Give half the box's sides.")
    return region


def _load(file: Path) -> AssetEdit:
    regions = _json(file).get("regions")
    if not isinstance(regions, list):
        raise AssetError("there is no list of regions", where=file, cure="Remove the file.")
    return AssetEdit(file.stem, tuple(region_of(region, file) for region in regions))


def _json(file: Path) -> dict:
    data = given_json(file, AssetError, "Mend or remove it.")
    if not isinstance(data, dict):
        raise AssetError("it is no JSON object", where=file, cure="Mend or remove it.")
    return data


ASSET_EDITS = Artifact(layout.ASSET_EDITS, load_edits)
"""What a person deleted from the asset."""
