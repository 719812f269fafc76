"""Shape priors after T_m* as a bundle holds them: those accepted, those refused, and the figures of all.

NumPy alone, so that Blender reads them too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_finite, require_indices, require_shapes, save_arrays
from ...core.errors import GeometryError
from ...core.json_files import opened_json, write_json

REFUSED = "refused"
"""The folder of those that were refused, beside the accepted ones."""

_RECORD = "priors.json"


@dataclass(frozen=True)
class AlignedPrior:
    """A shape prior after its similarity T_m*: ``vertices`` (V, 3) in the world, ``faces`` (F, 3).

    By symmetry it is only what the object's mirror image adds.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True)
class ObjectPrior:
    """What became of an object: ``prior`` is None where ``refusal`` says why.

    ``record`` has all figures; its ``backend`` says whence the prior is: "mesh" or "symmetry".
    ``refused`` is the best shape in its best pose where that was not good enough, to be looked at.
    """

    name: str
    prior: AlignedPrior | None
    refusal: str
    record: dict[str, Any]
    refused: AlignedPrior | None = None


def load_priors(folder: Path) -> tuple[AlignedPrior, ...]:
    """The accepted priors that ``save_priors`` wrote. Raises GeometryError for a damaged file."""
    return tuple(load_prior(path) for path in sorted(folder.glob("*.npz")))


def load_prior(file: Path) -> AlignedPrior:
    """One of them, or of those refused. Raises GeometryError for a damaged file."""
    with opened_arrays(file, GeometryError, "this is no aligned prior") as data:
        prior = AlignedPrior(file.stem, data["vertices"], data["faces"])
        require_shapes(vars(prior), vertices="V 3", faces="F 3")
        require_finite(vertices=prior.vertices)
        require_indices(len(prior.vertices), faces=prior.faces)
        return prior


def object_place(priors: Sequence[AlignedPrior], name: str) -> tuple[float, float]:
    """World x and y of the middle of the accepted prior ``name``. Raises GeometryError: there is none."""
    found = next((prior for prior in priors if prior.name == name), None)
    if found is None:
        known = ", ".join(prior.name for prior in priors)
        raise GeometryError(
            f"there is no aligned object '{name}'",
            where=layout.PRIORS,
            cure=f"Known: {known}." if known else "Declare objects with `r2sego objects`.",
        )
    x, y, _ = 0.5 * (found.vertices.min(axis=0) + found.vertices.max(axis=0))
    return float(x), float(y)


def save_priors(folder: Path, priors: Sequence[ObjectPrior]) -> None:
    """Write the accepted priors, those refused in ``refused/``, and ``priors.json`` with the figures
    of all."""
    for one in priors:
        if one.prior is not None:
            path = folder / f"{one.name}.npz"
            save_arrays(path, vertices=one.prior.vertices, faces=one.prior.faces)
        elif one.refused is not None:
            (folder / REFUSED).mkdir(exist_ok=True)
            path = folder / REFUSED / f"{one.name}.npz"
            save_arrays(path, vertices=one.refused.vertices, faces=one.refused.faces)
    write_json(folder / _RECORD, [one.record for one in priors])


def read_record(folder: Path) -> list[dict[str, Any]]:
    """The figures of every object, as ``save_priors`` wrote them. Raises GeometryError for a damaged file."""
    with opened_json(folder / _RECORD, GeometryError, "the record of the priors is damaged") as records:
        for record in records:
            if not isinstance(record["name"], str) or not isinstance(record["refusal"], str):
                raise TypeError("a record has no name")
        return list(records)


def _save(priors: Sequence[ObjectPrior], folder: Path) -> None:
    save_priors(folder, priors)


def _check(folder: Path) -> None:
    """Raises where a prior that the record tells of as accepted cannot be read."""
    accepted = {prior.name for prior in load_priors(folder)}
    for record in read_record(folder):
        if not record["refusal"] and record["name"] not in accepted:
            raise FileNotFoundError(record["name"])


PRIORS = Artifact(layout.PRIORS, load_priors, _save, _check)
"""The accepted priors after T_m*; those refused and the figures of all lie beside them."""

PRIOR_RECORDS = Artifact(layout.PRIORS, read_record)
"""The figures of every object that was aligned."""
