"""Coverage of the proxy: how many of the robot's candidate views see each face.

Beside it stands the number of captures that support the face. Faces that the robot sees and
no capture supports are the paper's support gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ...bundle.artifacts import Artifact
from ...core.arrays import opened_arrays, require_finite, require_indices, require_shapes, save_arrays
from ...core.cameras import Camera
from ...core.errors import GeometryError
from ...core.progress import SILENT, Progress

COVERAGE_SIDE_PX = 96
"""Candidate views are drawn with at most this many pixels a side: faces, not pixels, are asked."""

_VIEWS_A_CALL = 256  # between two looks at the progress


@dataclass(frozen=True)
class Coverage:
    """What sees the faces of a proxy.

    ``seen`` (F,) uint32: candidate views that see the face's free side; ``support`` (F,)
    uint16: captures that do; ``area_m2`` (F,) float32; ``views``: candidates there are.
    """

    seen: np.ndarray
    support: np.ndarray
    area_m2: np.ndarray
    views: int

    def save(self, path: Path) -> None:
        """Write the arrays as an uncompressed ``.npz``."""
        save_arrays(path, **{field.name: np.asarray(getattr(self, field.name)) for field in fields(self)})

    @staticmethod
    def load(path: Path) -> Coverage:
        """Read what ``save`` wrote. Raises GeometryError when the file is none of it."""
        cure = "Measure the coverage again (`r2sego coverage`)."
        with opened_arrays(path, GeometryError, "this is no coverage of a proxy", cure) as data:
            arrays = {field.name: data[field.name] for field in fields(Coverage)}
            require_shapes(arrays, seen="F", support="F", area_m2="F", views="")
            require_finite(area_m2=arrays["area_m2"])
            require_indices(1 << 32, seen=arrays["seen"], support=arrays["support"], views=arrays["views"])
        views = int(arrays.pop("views"))
        return Coverage(**arrays, views=views)

    def areas_m2(self) -> dict[str, float]:
        """Sums of area: ``proxy``, ``supported`` by a capture, ``seen`` by the robot, and of the
        latter ``gap`` (no capture supports it), ``weak`` (one does), ``covered`` (two at least)."""
        seen, area = self.seen > 0, self.area_m2.astype(np.float64)
        parts = {
            "proxy": np.ones(len(area), bool),
            "supported": self.support > 0,
            "seen": seen,
            "gap": seen & (self.support == 0),
            "weak": seen & (self.support == 1),
            "covered": seen & (self.support > 1),
        }
        return {name: float(area[faces].sum()) for name, faces in parts.items()}


def face_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) float32 areas, square metres of vertices in metres."""
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, k]] for k in range(3))
    return (np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2).astype(np.float32)


def count_seen(
    vertices: np.ndarray, faces: np.ndarray, cameras: Sequence[Camera], progress: Progress = SILENT
) -> np.ndarray:
    """(F,) uint32: how many ``cameras``, which share one lens, see the free side of each face.

    A face counts where its middle is in the image and nothing nearer is drawn at that pixel, or
    where a pixel shows it. Views are drawn at most ``COVERAGE_SIDE_PX`` wide. The result does
    not depend on the number of threads. Raises GeometryError for a mesh that cannot be drawn.
    """
    from ..mesh.meshes import require_sound  # the engine's, both: Blender's Python reads coverage without them
    from .visible_faces import count_views

    vertices = np.ascontiguousarray(vertices, np.float64).reshape(-1, 3)
    faces = np.ascontiguousarray(faces, np.int32).reshape(-1, 3)
    require_sound(vertices, faces)
    seen = np.zeros(len(faces), np.uint32)
    if not len(cameras):
        return seen
    small = cameras[0].fitted(COVERAGE_SIDE_PX)
    lens = np.array([small.fx, small.fy, small.cx, small.cy])
    with progress.task("Counting what the robot sees", len(cameras)) as task:
        for first in range(0, len(cameras), _VIEWS_A_CALL):
            part = cameras[first : first + _VIEWS_A_CALL]
            poses = np.stack([camera.camera_from_world[:3] for camera in part])
            seen += count_views(poses, lens, small.width, small.height, vertices, faces)
            task.advance(len(part))
    return seen


def _load(folder: Path) -> Coverage:
    return Coverage.load(folder / COVERAGE_FILE)


COVERAGE_FILE = "coverage.npz"

COVERAGE = Artifact("coverage", _load, editable=False)
"""How many of a round's views see each face: ``COVERAGE.of_round(l)``."""
