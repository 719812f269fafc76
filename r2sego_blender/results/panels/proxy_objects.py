"""What a bundle knows of its objects: masks, meshes, decisions, and how their priors fit. No bpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.figures import read_table
from ...core.arrays import require_finite
from ...core.errors import GeometryError
from ...core.json_files import finite_number
from ...geometry.objects.prior_files import PRIOR_RECORDS, REFUSED, load_prior
from .bundle import Bundle

_CURE = "Run `r2sego refine` again."


@dataclass(frozen=True)
class KnownObject:
    """An object of the bundle, or one that is not ``declared`` in it yet.

    ``state`` in a word or two, ``why`` a prior was refused; ``iou`` and ``energy`` of the last
    run, ``residual_m`` of its observed points, -1 where there is none. ``placed``: its pose is
    set or held by hand. ``world_from_own`` (4, 4) is where the prior stands, None without one.
    """

    name: str
    state: str
    masks: int
    declared: bool
    why: str = ""
    shape: str = ""
    iou: float = -1.0
    energy: float = -1.0
    residual_m: float = -1.0
    has_prior: bool = False
    own_mesh: bool = False
    placed: bool = False
    world_from_own: np.ndarray | None = None


def read_objects(bundle: Bundle) -> list[KnownObject]:
    """The declared objects in the order of their names. Raises GeometryError naming a damaged file."""
    folder = bundle.path / "objects"
    if not folder.is_dir():
        return []
    there = (bundle.scene.geometry_folder / "priors" / "priors.json").is_file()
    known = {one["name"]: one for one in (bundle.read(PRIOR_RECORDS) if there else [])}
    return [_object(bundle, place, known.get(place.name, {})) for place in sorted(folder.iterdir()) if place.is_dir()]


def prior_file(bundle: Bundle, name: str) -> Path | None:
    """The mesh in the world that the last run placed for an object, refused ones too; None without."""
    folder = bundle.scene.geometry_folder / "priors"
    files = (folder / f"{name}.npz", folder / REFUSED / f"{name}.npz")
    return next((file for file in files if file.is_file()), None)


def prior_mesh(bundle: Bundle, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) in the world and faces (F, 3) of an object's prior. Raises GeometryError: none."""
    file = prior_file(bundle, name)
    if file is None:
        raise GeometryError(
            f"'{name}' has no prior to show", where=bundle.path, cure="Refine first, or give the object a mesh."
        )
    prior = load_prior(file)
    return prior.vertices.astype(np.float64), prior.faces.astype(np.int32)


def mask_files(bundle: Bundle, name: str) -> dict[str, Path]:
    """The declared masks of an object by their stems, see ``layout.mask_stems``."""
    return {file.stem: file for file in sorted((bundle.path / "objects" / name / "masks").glob("*.png"))}


def _object(bundle: Bundle, place: Path, record: Mapping[str, Any]) -> KnownObject:
    placement = place / "placement.json"
    held = read_table(placement) if placement.is_file() else {}
    decision = place / "decision.json"
    decided = read_table(decision).get("decision", "") if decision.is_file() else ""
    locked = bool(held.get("locked", False))
    pose = record.get("world_from_own")
    try:
        iou, energy, distance_m = (
            _number(record.get(name)) for name in ("silhouette_iou", "energy", "point_distance_m")
        )
        placed_at = np.eye(4) if pose is None else np.array(pose, np.float64).reshape(4, 4)
        require_finite(world_from_own=placed_at)
    except (TypeError, ValueError) as error:
        raise GeometryError(
            f"the record of '{place.name}' is damaged: {error}",
            where=bundle.scene.geometry_folder / "priors" / "priors.json",
            cure=_CURE,
        ) from error
    return KnownObject(
        place.name,
        _state(record, decided, locked, bool(held)),
        len(mask_files(bundle, place.name)),
        True,
        str(record.get("refusal", "")),
        str(record.get("shape", "")),
        iou,
        energy,
        distance_m,
        prior_file(bundle, place.name) is not None,
        any(place.glob("mesh.*")),
        bool(held),
        None if pose is None else placed_at,
    )


def _state(record: Mapping[str, Any], decided: str, locked: bool, placed: bool) -> str:
    if decided == "reject":
        return "rejected"
    if locked:
        return "locked"
    if decided == "accept":
        return "accepted"
    if record.get("refusal"):
        return "refused"
    if record.get("backend") == "symmetry":
        return "by symmetry"
    if "shape" in record:
        return "aligned"
    return "placed" if placed else "not run yet"


def _number(value: Any) -> float:
    return -1.0 if value is None else finite_number(value)
