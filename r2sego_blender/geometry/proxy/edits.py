"""Edits of the proxy by hand: faces cut away, and surfaces drawn.

They stand in the bundle's ``geometry/edits/``, one ``.npz`` an edit, and are applied in their
order to the proxy of each round. A cut is kept as samples of what was removed and of what
stayed around it: a face of any round goes where the nearest sample was removed, so that the
proxy it was made on loses exactly the chosen faces, and a later one the same region.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ...bundle import layout
from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_finite, require_indices, require_shapes, save_arrays
from ...core.errors import GeometryError
from ...core.file_names import plain_name

_AXES = {
    "cut": {"removed": "K 6", "kept": "N 6", "reach_m": "", "area_m2": ""},
    "draw": {"vertices": "V 3", "faces": "F 3", "area_m2": ""},
}
"""Of an edit's arrays, by its kind."""

_CURE = "Remove it (`r2sego edit-proxy SCENE --remove NAME`), or make it again."


@dataclass(frozen=True)
class Cut:
    """Faces cut away, on the proxy of one round.

    ``removed`` (K, 6) and ``kept`` (N, 6) float64: middles of faces, metres, and their unit
    normals, of what was removed and of what stayed within ``reach_m`` of it; ``area_m2`` of it.
    """

    kind: ClassVar[str] = "cut"
    removed: np.ndarray
    kept: np.ndarray
    reach_m: float
    area_m2: float

    def transformed(self, similarity: np.ndarray) -> Cut:
        """This cut after a (4, 4) similarity of the world."""
        scale = np.cbrt(np.linalg.det(similarity[:3, :3]))

        def moved(samples: np.ndarray) -> np.ndarray:
            places = samples[:, :3] @ similarity[:3, :3].T + similarity[:3, 3]
            return np.concatenate([places, samples[:, 3:] @ similarity[:3, :3].T / scale], axis=1)

        return Cut(moved(self.removed), moved(self.kept), float(self.reach_m * scale), float(self.area_m2 * scale**2))


@dataclass(frozen=True)
class Drawn:
    """A surface drawn by hand: ``vertices`` (V, 3) float64 world metres, ``faces`` (F, 3) int32,
    counter-clockwise from the free side; ``area_m2`` of it."""

    kind: ClassVar[str] = "draw"
    vertices: np.ndarray
    faces: np.ndarray
    area_m2: float

    def transformed(self, similarity: np.ndarray) -> Drawn:
        """This surface after a (4, 4) similarity of the world."""
        linear = similarity[:3, :3]
        vertices = self.vertices @ linear.T + similarity[:3, 3]
        return Drawn(vertices, self.faces, float(self.area_m2 * np.linalg.det(linear) ** (2 / 3)))


@dataclass(frozen=True)
class Edit:
    """A named edit; those of lower ``order`` are applied first."""

    name: str
    order: int
    change: Cut | Drawn

    @property
    def count(self) -> int:
        """The faces it takes or adds."""
        return len(self.change.removed if isinstance(self.change, Cut) else self.change.faces)

    def transformed(self, similarity: np.ndarray) -> Edit:
        """This edit after a (4, 4) similarity of the world."""
        return replace(self, change=self.change.transformed(similarity))

    def save(self, folder: Path) -> None:
        """Write ``<name>.npz`` into the folder of the edits."""
        arrays = {f.name: np.asarray(getattr(self.change, f.name)) for f in fields(self.change)}
        order = np.array(self.order, np.int64)
        save_arrays(folder / f"{self.name}.npz", kind=self.change.kind, order=order, **arrays)


def load_proxy_edits(folder: Path) -> tuple[Edit, ...]:
    """The edits in a folder in their order; none if it is not there.

    Raises GeometryError naming the damaged file.
    """
    edits = [_load(path) for path in sorted(folder.glob("[!.]*.npz"))]
    return tuple(sorted(edits, key=lambda edit: (edit.order, edit.name)))


def new_name(wanted: str, taken: Sequence[str]) -> str:
    """A name for a further edit, with a number behind it where it is taken."""
    plain = name = plain_name(wanted)
    number = 2
    while name.lower() in {other.lower() for other in taken}:
        name, number = f"{plain}_{number}", number + 1
    return name


def _load(path: Path) -> Edit:
    with opened_arrays(path, GeometryError, "this is no edit of the proxy", _CURE) as data:
        kind = {one.kind: one for one in (Cut, Drawn)}[str(data["kind"])]
        arrays = {field.name: data[field.name] for field in fields(kind)}
        require_shapes(arrays, **_AXES[kind.kind])
        require_finite(**arrays)
        told: dict[str, Any] = {name: value if value.ndim else float(value) for name, value in arrays.items()}
        change = kind(**told)
        if isinstance(change, Drawn):
            require_indices(len(change.vertices), faces=change.faces)
        return Edit(path.stem, int(data["order"]), change)


PROXY_EDITS = Artifact(layout.PROXY_EDITS, load_proxy_edits)
"""What a person cut away from the proxy and drew."""
