"""The surfaces that frozen views look at: the proxy's, the true room's where its mesh is known, and what captures saw.

The true room is told by the mesh that lies beside the frozen views. It is read for scoring only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...bundle.scene import Scene
from ...captures.capture import Capture
from ...captures.store import CAPTURES
from ...core.errors import EvaluationError
from ...core.progress import SILENT, Progress
from ...geometry.proxy.proxy import PROXY, GeometryProxy
from ...geometry.visibility.rasterizer import MeshRasterizer
from ..ground_truth import TRUE_MESH, load_true_mesh, points_of_views
from .figures import PROXY_ALONE, TRUE_ROOM
from .geometry_errors import TRUE_SAMPLES, VISIBLE_SPACING_M, Surface
from .regions import seen_by_captures

_SAME_ROOM_M = 0.3
"""A true mesh is of this room and in its frame when half of what the captures see lies this
near to the proxy."""


@dataclass(frozen=True)
class ViewSurface:
    """What one frozen view looks at: planar depths (H, W) float32 in metres, 0 where there is no surface.

    ``true_depth`` is None where the true room is not known; ``seen`` (H, W) bool: what some capture saw too.
    """

    proxy_depth: np.ndarray
    true_depth: np.ndarray | None
    seen: np.ndarray

    @property
    def known_depth(self) -> np.ndarray:
        """The true depth, else the proxy's."""
        return self.proxy_depth if self.true_depth is None else self.true_depth


@dataclass(frozen=True)
class TrueRoom:
    """The true surface in the world frame: ``vertices`` (V, 3) metres, ``faces`` (F, 3), and what captures truly see
    of it, ``visible`` (P, 3)."""

    vertices: np.ndarray
    faces: np.ndarray
    visible: np.ndarray

    def surface(self, rng: np.random.Generator) -> Surface:
        """It as other surfaces are scored against."""
        return Surface(self.vertices, self.faces, TRUE_SAMPLES, rng)


@dataclass(frozen=True)
class SceneSurfaces:
    """Those of all frozen views, in their order, and the last round's ``proxy``.

    ``told_by`` is ``TRUE_ROOM`` or ``PROXY_ALONE``; ``note`` says why a true mesh was not used.
    """

    told_by: str
    note: str
    proxy: GeometryProxy
    true: TrueRoom | None
    views: tuple[ViewSurface, ...]


def surfaces_of(scene: Scene, frozen: Path, views: Sequence[Capture], progress: Progress = SILENT) -> SceneSurfaces:
    """What ``views`` look at; a ``room.npz`` beside ``frozen``, which they were read of, is the true room.

    Raises GeometryError when the last round's proxy is not there.
    """
    last = scene.newest_round("asset.ply")  # of earlier ones the asset may be gone
    proxy = scene.read(PROXY.of_round(max(last, 0)))
    found = MeshRasterizer(proxy.vertices, proxy.faces)
    captures = [capture.camera for capture in scene.read(CAPTURES)]
    in_captures = [found.render(camera).depth for camera in captures]
    mesh, note = _true_mesh(scene, frozen)
    true, room = None, None
    if mesh is not None:
        room = MeshRasterizer(*mesh)
        truly_in_captures = [room.render(camera).depth for camera in captures]
        if _same_room(in_captures, truly_in_captures):
            in_captures = truly_in_captures
            true = TrueRoom(*mesh, points_of_views(captures, in_captures, VISIBLE_SPACING_M))
        else:
            room, note = None, f"{TRUE_MESH} beside the frozen views is not in the frame of the captures"
    shown = []
    for view in progress.track(views, "What captures saw"):
        depth = found.render(view.camera).depth
        true_depth = None if room is None else room.render(view.camera).depth
        known = depth if true_depth is None else true_depth
        shown.append(ViewSurface(depth, true_depth, seen_by_captures(view.camera, known, captures, in_captures)))
    return SceneSurfaces(PROXY_ALONE if true is None else TRUE_ROOM, note, proxy, true, tuple(shown))


def _true_mesh(scene: Scene, frozen: Path) -> tuple[tuple[np.ndarray, np.ndarray] | None, str]:
    """The true room's vertices and faces in the world frame, or None and why; no words where no mesh lies there."""
    folders = [frozen, frozen.parent] if frozen.is_dir() else [frozen.parent]
    file = next((folder / TRUE_MESH for folder in folders if (folder / TRUE_MESH).is_file()), None)
    if file is None:
        return None, ""
    try:
        vertices, faces = load_true_mesh(file)
    except EvaluationError as error:
        return None, f"{TRUE_MESH} beside the frozen views cannot be used: {error.what}"
    similarity = np.array(scene.declaration.world_from_capture)
    return (vertices @ similarity[:3, :3].T + similarity[:3, 3], faces), ""


def _same_room(proxy_depths: Sequence[np.ndarray], true_depths: Sequence[np.ndarray]) -> bool:
    apart = [
        np.where((a > 0.0) & (b > 0.0), np.abs(a - b), np.inf).ravel()
        for a, b in zip(proxy_depths, true_depths, strict=True)
    ]
    return bool(np.median(np.concatenate(apart)) <= _SAME_ROOM_M)
