"""Ground truth of a made-up scene: true depth of the captures and the true surface.

Scores are computed against it and nothing else: no step of the pipeline may read it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..bundle.layout import mask_stems
from ..captures.poses.cameras_json import read_cameras_json
from ..captures.poses.photographs import ANY_SIZE_PX, Photograph, captures_of
from ..core.arrays import opened_arrays, save_arrays
from ..core.cameras import Camera
from ..core.errors import EvaluationError

TRUE_MESH = "room.npz"
"""The file of the true surface, beside the ``cameras.json`` in whose frame it is."""

_CURE = "Make the scene's ground truth again."


@dataclass(frozen=True)
class TrueView:
    """What a capture truly sees.

    ``depth`` (H, W) float32 planar z, 0 where nothing is known; ``ids`` (H, W) int16, the
    instance, an index of ``GroundTruth.names``, -1 for none.
    """

    name: str
    camera: Camera
    depth: np.ndarray
    ids: np.ndarray


@dataclass(frozen=True)
class GroundTruth:
    """The true scene, in the frame of its ``cameras.json`` until it is ``transformed``.

    ``views`` are the captures' in the order of that file; ``vertices`` (V, 3) float64 and
    ``faces`` (F, 3) int32 are the true surface, ``instances`` (F,) int64 what each face
    belongs to, an index of ``names``.
    """

    views: tuple[TrueView, ...]
    vertices: np.ndarray
    faces: np.ndarray
    instances: np.ndarray
    names: tuple[str, ...]

    def transformed(self, similarity: np.ndarray) -> GroundTruth:
        """The same scene after a (4, 4) similarity, depths scaled with it."""
        scale = np.cbrt(np.linalg.det(similarity[:3, :3]))
        views = tuple(
            replace(view, camera=view.camera.transformed(similarity), depth=(view.depth * scale).astype(np.float32))
            for view in self.views
        )
        vertices = self.vertices @ similarity[:3, :3].T + similarity[:3, 3]
        return replace(self, views=views, vertices=vertices)

    def visible_points(self, spacing_m: float) -> np.ndarray:
        """(P, 3) float64: the surface that the captures truly see, one point a voxel."""
        return points_of_views([view.camera for view in self.views], [view.depth for view in self.views], spacing_m)


def points_of_views(cameras: Sequence[Camera], depths: Sequence[np.ndarray], spacing_m: float) -> np.ndarray:
    """(P, 3) float64: the surface in planar depths (H, W), 0 unknown, one point a voxel."""
    seen = np.concatenate([camera.unproject(z)[z > 0.0] for camera, z in zip(cameras, depths, strict=True)])
    _, first = np.unique(np.floor(seen / spacing_m).astype(np.int64), axis=0, return_index=True)
    return seen[first]


def load_ground_truth(folder: Path) -> GroundTruth:
    """Read ``cameras.json`` (captures alone), ``depth/*.npz`` and ``room.npz`` of a scene folder.

    ``depth/NAME.npz`` of the photograph NAME.* (of those that share a NAME, as ``layout.mask_stems``
    calls them) holds ``z`` (H, W), planar, in the unit of
    the poses, and ``ids`` (H, W); ``room.npz`` holds ``V`` (V, 3), ``F`` (F, 3), ``I`` (F,)
    and ``names``. Raises EvaluationError for files that are missing, damaged or do not fit
    together, CaptureError for the camera file.
    """
    folder = Path(folder)
    photographs, _ = read_cameras_json(folder / "cameras.json", folder)
    cameras = [capture.camera for capture in captures_of(photographs, ANY_SIZE_PX)]
    vertices, faces, instances, names = _surface(folder / TRUE_MESH)
    views = _views(photographs, cameras, folder / "depth", len(names))
    return GroundTruth(views, vertices, faces, instances, names)


def save_ground_truth(truth: GroundTruth, folder: Path) -> None:
    """Write ``depth/*.npz`` and ``room.npz`` into a scene folder, as ``load_ground_truth`` reads them.

    Its ``cameras.json`` must name a photograph for each of the views.
    """
    (folder / "depth").mkdir(exist_ok=True)
    for view in truth.views:
        save_arrays(folder / "depth" / f"{view.name}.npz", z=view.depth, ids=view.ids)
    save_arrays(folder / TRUE_MESH, V=truth.vertices, F=truth.faces, I=truth.instances, names=np.array(truth.names))


def load_true_mesh(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """The true surface of a ``room.npz`` alone: (V, 3) float64 vertices and (F, 3) int32 faces.

    Raises EvaluationError for a file that is missing or damaged.
    """
    vertices, faces, _, _ = _surface(Path(file))
    return vertices, faces


def _surface(file: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[str, ...]]:
    with opened_arrays(_there(file), EvaluationError, "this is no true surface", _CURE) as data:
        vertices = np.asarray(data["V"], np.float64).reshape(-1, 3)
        faces = np.asarray(data["F"], np.int32).reshape(-1, 3)
        instances = np.asarray(data["I"], np.int64).reshape(-1)
        names = tuple(map(str, data["names"].tolist()))
    _check_surface(vertices, faces, instances, names, file)
    return vertices, faces, instances, names


def _views(
    photographs: Sequence[Photograph], cameras: Sequence[Camera], folder: Path, instances: int
) -> tuple[TrueView, ...]:
    views = []
    names = [str(Path(photograph.name).with_name(photograph.path.name)) for photograph in photographs]
    for stem, camera in zip(mask_stems(names).values(), cameras, strict=True):
        file = folder / f"{stem}.npz"
        with opened_arrays(_there(file), EvaluationError, "this is no true depth", _CURE) as data:
            depth = np.asarray(data["z"], np.float32)
            ids = np.asarray(data["ids"], np.int16)
        if depth.shape != camera.shape or ids.shape != camera.shape:
            raise EvaluationError(
                f"z has the shape {depth.shape}, ids {ids.shape}, the photograph {camera.shape}", where=file, cure=_CURE
            )
        if ids.size and not -1 <= ids.min() <= ids.max() < instances:
            raise EvaluationError(
                f"ids name instances from {ids.min()} to {ids.max()}, of {instances}", where=file, cure=_CURE
            )
        known = np.isfinite(depth) & (depth > 0.0)
        views.append(TrueView(stem, camera, np.where(known, depth, np.float32(0.0)), ids))
    return tuple(views)


def _there(file: Path) -> Path:
    if not file.is_file():
        raise EvaluationError(
            "there is no such file", where=file, cure="Give a folder with cameras.json, depth/*.npz and room.npz."
        )
    return file


def _check_surface(
    vertices: np.ndarray, faces: np.ndarray, instances: np.ndarray, names: Sequence[str], file: Path
) -> None:
    problem = None
    if not len(faces):
        problem = "the true surface has no faces"
    elif not np.isfinite(vertices).all():
        problem = "V holds values that are not finite"
    elif not 0 <= faces.min() <= faces.max() < len(vertices):
        problem = "F names vertices that are not in V"
    elif len(instances) != len(faces):
        problem = f"I has {len(instances)} entries for {len(faces)} faces"
    elif not 0 <= instances.min() <= instances.max() < len(names):
        problem = "I names instances that are not in names"
    if problem:
        raise EvaluationError(problem, where=file, cure=_CURE)
