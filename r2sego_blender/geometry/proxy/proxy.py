"""The geometry proxy M_scaf: one triangle mesh that knows where each face comes from."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_finite, require_indices, require_shapes, save_arrays
from ...core.errors import GeometryError


class Provenance(IntEnum):
    """Where a face of the proxy comes from."""

    OBSERVED = 0
    PRIOR = 1
    COMPLETED = 2
    MEASURED = 3
    ESTIMATED = 4


PROVENANCE_COLOURS = {
    Provenance.OBSERVED: (0.62, 0.63, 0.65),
    Provenance.PRIOR: (0.13, 0.62, 0.59),
    Provenance.COMPLETED: (0.90, 0.64, 0.20),
    Provenance.MEASURED: (0.42, 0.55, 0.80),
    Provenance.ESTIMATED: (0.72, 0.45, 0.66),
}
"""Capture grey and prior teal as in the paper's figures, completed amber, a sensor's blue, estimated mauve; sRGB
in [0, 1]."""


_INSTANCES = ("instance", "instance_names")


@dataclass(frozen=True)
class GeometryProxy:
    """A triangle mesh in the world frame, metres, with the evidence for each face.

    ``vertices`` (V, 3) float32; ``faces`` (F, 3) int32, counter-clockwise from the free
    side; ``provenance`` (F,) uint8 of ``Provenance``; ``support`` (F,) uint16, the number
    of captures that saw the face; ``confidence`` (F,) float32 in [0, 1]; ``instance`` (F,)
    int32, 0 for the room and k for the object ``instance_names[k - 1]`` whose prior the
    face is of (by default all are the room's).
    """

    vertices: np.ndarray
    faces: np.ndarray
    provenance: np.ndarray
    support: np.ndarray
    confidence: np.ndarray
    instance: np.ndarray = None  # type: ignore[assignment]  # until it is made
    instance_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.instance is None:
            object.__setattr__(self, "instance", np.zeros(len(self.faces), np.int32))

    def save(self, path: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        save_arrays(path, **arrays | {"instance_names": np.array(self.instance_names, np.str_)})

    def save_ply(self, path: Path) -> None:
        """Write the mesh as a binary PLY: faces coloured by provenance, and their ``instance``."""
        import trimesh  # the engine's; Blender's Python reads proxies without it

        palette = np.rint(np.array([PROVENANCE_COLOURS[p] for p in Provenance]) * 255).astype(np.uint8)
        mesh = trimesh.Trimesh(self.vertices, self.faces, face_colors=palette[self.provenance], process=False)
        mesh.face_attributes["instance"] = self.instance
        written = mesh.export(file_type="ply")
        assert isinstance(written, bytes)
        path.write_bytes(written)

    @staticmethod
    def load(path: Path) -> GeometryProxy:
        """Read what ``save`` wrote, or an older file, without instances.

        Raises GeometryError when the file is no proxy.
        """
        with opened_arrays(path, GeometryError, "this is not a geometry proxy") as data:
            names = [field.name for field in fields(GeometryProxy)]
            kept = [name for name in names if name in data or name not in _INSTANCES]
            arrays: dict[str, Any] = {name: data[name] for name in kept}
            if "instance_names" in arrays:
                arrays["instance_names"] = tuple(map(str, arrays["instance_names"].tolist()))
            proxy = GeometryProxy(**arrays)
            require_shapes(
                vars(proxy), vertices="V 3", faces="F 3", provenance="F", support="F", confidence="F", instance="F"
            )
            require_finite(vertices=proxy.vertices)
            require_indices(len(Provenance), provenance=proxy.provenance)
            require_indices(len(proxy.vertices), faces=proxy.faces)
            require_indices(len(proxy.instance_names) + 1, instance=proxy.instance)
            require_indices(1 << 16, support=proxy.support)
            if not ((proxy.confidence >= 0.0) & (proxy.confidence <= 1.0)).all():
                raise ValueError("a face has a confidence outside of 0 to 1")
            return proxy


def _load(folder: Path) -> GeometryProxy:
    return GeometryProxy.load(folder / PROXY_FILE)


def _save(proxy: GeometryProxy, folder: Path) -> None:
    proxy.save(folder / PROXY_FILE)
    proxy.save_ply(folder / "proxy.ply")


PROXY_FILE = "proxy.npz"
"""In a round's folder ``proxy/``."""

PROXY = Artifact("proxy", _load, _save)
"""M_scaf of a round: ``PROXY.of_round(l)``."""
