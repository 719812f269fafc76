"""What Blender reads from a scene bundle: the one place that knows its files. No bpy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.artifacts import Artifact, Held
from ...bundle.figures import METRICS
from ...bundle.layout import REPORT_PAGE
from ...bundle.scene import Scene
from ...captures.registered_views import REGISTERED_VIEWS, RegisteredView
from ...captures.sparse_points import SPARSE
from ...core.cameras import Camera
from ...core.errors import SceneError
from ...generation.view_records import read_camera_path
from ...geometry.proxy.proxy import PROXY, GeometryProxy
from ...views.selection import CANDIDATE_POSES, CHOICE, Selection

SUFFIX = ".r2s"
_CURE = "Run the step that makes it again (`r2sego refine`)."


@dataclass(frozen=True)
class CandidateViews:
    """The candidate stream of a round: from where it looks, and what became of each.

    ``camera`` is the lens of all; ``poses`` (M, 4, 4) float64 ``world_from_camera``.
    """

    camera: Camera
    poses: np.ndarray
    selection: Selection


class Bundle:
    """A scene bundle, read only."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @staticmethod
    def open(path: str | Path) -> Bundle:
        """Open the bundle at ``path``. Raises SceneError when there is none."""
        return Bundle(Scene.open(Path(path).absolute()))

    @property
    def path(self) -> Path:
        """The bundle's folder."""
        return self.scene.path

    @property
    def name(self) -> str:
        """The folder's name without its suffix."""
        return self.path.name.removesuffix(SUFFIX)

    def read(self, artifact: Artifact[Held]) -> Held:
        """What the bundle holds under an artifact's name (``Scene.read``)."""
        return self.scene.read(artifact)

    # ---- captures

    def captures(self) -> tuple[RegisteredView, ...]:
        """Every registered photograph. Raises CaptureError when ``cameras.json`` is damaged."""
        return self.read(REGISTERED_VIEWS)

    @property
    def sparse_file(self) -> Path:
        """The triangulated points."""
        return self.scene.captures_folder / "sparse.npz"

    def sparse_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (P, 3) float32 in metres and their colours (P, 3) uint8 sRGB."""
        sparse = self.read(SPARSE)
        return sparse.points.astype(np.float32), sparse.colours.astype(np.uint8)

    # ---- rounds

    def proxy_file(self, round_index: int) -> Path:
        """The geometry proxy of a round."""
        return self.scene.round_folder(round_index) / "proxy" / "proxy.npz"

    def selection_folder(self, round_index: int) -> Path:
        """The scored candidate stream of a round and its target views."""
        return self.scene.round_folder(round_index) / "selection"

    def rounds(self) -> int:
        """How many rounds have begun: the first without a geometry proxy ends the count."""
        count = 0
        while self.proxy_file(count).is_file():
            count += 1
        return count

    def proxy(self, round_index: int) -> GeometryProxy:
        """The geometry proxy of a round. Raises SceneError when that round has none."""
        file = self.proxy_file(round_index)
        _require(file, f"round {round_index} has no geometry proxy")
        return self.read(PROXY.of_round(round_index))

    def candidates(self, round_index: int) -> CandidateViews:
        """The scored candidates of a round. Raises SceneError when that round has none, GenerationError
        when the selection is damaged."""
        folder = self.selection_folder(round_index)
        _require(folder / "selection.npz", f"round {round_index} has no candidate views")
        selection = self.read(CHOICE.of_round(round_index))
        camera, poses = self.read(CANDIDATE_POSES.of_round(round_index))
        if len(selection.score) != len(poses):
            raise SceneError("selection.npz and candidates.npz do not belong together", where=folder, cure=_CURE)
        return CandidateViews(camera, poses, selection)

    def camera_path(self, round_index: int, view: int) -> list[Camera]:
        """The cameras of a target view's clip, reference first, all with the target's lens.

        ``view`` is its rank. Raises SceneError when that view has no clip.
        """
        folder = self.scene.round_folder(round_index) / "views"
        file = folder / f"{view:03d}" / "path.json"
        if not file.is_file():
            raise SceneError(
                f"round {round_index} has no camera path for view {view}",
                where=folder,
                cure="Choose another view or round.",
            )
        return read_camera_path(file)

    # ---- results

    @property
    def asset_file(self) -> Path:
        """The refined visual asset."""
        return self.scene.asset_file

    @property
    def collision_mesh(self) -> Path:
        """The collision surface as one mesh."""
        return self.scene.collision_folder / "mesh.obj"

    @property
    def collision_hulls(self) -> list[Path]:
        """The convex pieces of the collision surface."""
        return sorted((self.scene.collision_folder / "hulls").glob("*.obj"))

    @property
    def report_page(self) -> Path:
        """The report."""
        return self.scene.report_folder / REPORT_PAGE

    def metrics(self) -> dict[str, Any]:
        """The report's figures, empty when there are none."""
        return self.read(METRICS)


def _require(file: Path, otherwise: str) -> None:
    if not file.is_file():
        raise SceneError(otherwise, where=file, cure="Run Refine first, or choose another round.")
