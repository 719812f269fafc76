"""What Blender reads from a scene bundle: the one place that knows its files. No bpy."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bundle.artifacts import Artifact, Held
from ...bundle.layout import REPORT_PAGE
from ...bundle.scene import Scene
from ...core.arrays import opened_arrays, require_finite, require_shapes
from ...core.cameras import Camera
from ...core.errors import SceneError
from ...geometry.proxy.proxy import GeometryProxy

SUFFIX = ".r2s"
_SCORES = ("rollout", "frame", "deficit", "availability", "score", "survived", "rank", "chosen")
_CURE = "Run the step that makes it again (`r2sego refine`)."
_NEW = "Make the scene anew with `r2sego new`."


@dataclass(frozen=True)
class CapturedView:
    """A photograph and its camera in the world frame."""

    name: str
    image_path: Path
    camera: Camera


@dataclass(frozen=True)
class CandidateViews:
    """The candidate stream of a round with its scores.

    ``camera`` is the lens of all; ``poses`` (M, 4, 4) float64 ``world_from_camera``;
    ``rollout``, ``frame`` (M,) int; ``deficit``, ``availability``, ``score`` (M,) float;
    ``survived``, ``chosen`` (M,) bool; ``rank`` (M,) int, -1 = none.
    """

    camera: Camera
    poses: np.ndarray
    rollout: np.ndarray
    frame: np.ndarray
    deficit: np.ndarray
    availability: np.ndarray
    score: np.ndarray
    survived: np.ndarray
    rank: np.ndarray
    chosen: np.ndarray

    def targets(self) -> np.ndarray:
        """(K,) int, the chosen candidates' indices in the order of their rank."""
        chosen = np.flatnonzero(self.chosen)
        return chosen[np.argsort(self.rank[chosen], kind="stable")]


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

    def captures(self) -> list[CapturedView]:
        """Every registered photograph. Raises SceneError when ``cameras.json`` is damaged."""
        file = self.scene.captures_folder / "cameras.json"
        data = _json(file, _NEW)
        try:
            return [
                CapturedView(item["name"], self.scene.captures_folder / item["file"], Camera.from_json(item))
                for item in data["captures"]
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise _damaged(file, f"the field {error} is missing or wrong", _NEW) from error

    @property
    def sparse_file(self) -> Path:
        """The triangulated points."""
        return self.scene.captures_folder / "sparse.npz"

    def sparse_points(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (P, 3) float32 in metres and their colours (P, 3) uint8 sRGB."""
        with opened_arrays(self.sparse_file, SceneError, "it cannot be read", _NEW) as data:
            require_shapes(data, points="P 3", colours="P 3")
            return data["points"].astype(np.float32), data["colours"].astype(np.uint8)

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
        return GeometryProxy.load(file)

    def candidates(self, round_index: int) -> CandidateViews:
        """The scored candidates of a round. Raises SceneError when that round has none."""
        folder = self.selection_folder(round_index)
        _require(folder / "selection.npz", f"round {round_index} has no candidate views")
        scores = _arrays(folder / "selection.npz", *_SCORES)
        poses = _poses(folder / "candidates.npz")
        lens_file = folder / "candidates.json"
        try:
            lens = _json(lens_file)["camera"]
            camera = Camera.from_json({**lens, "world_from_camera": np.eye(4)})
        except (KeyError, TypeError, ValueError) as error:
            raise _damaged(lens_file, f"the field {error} is missing or wrong") from error
        if {array.shape for array in scores.values()} != {(len(poses),)}:
            raise _damaged(folder, "selection.npz and candidates.npz do not belong together")
        return CandidateViews(camera=camera, poses=poses, **scores)

    def camera_path(self, round_index: int, view: int) -> list[Camera]:
        """The cameras of a target view's clip, reference first, all with the target's lens.

        ``view`` is its rank. Raises SceneError when that view has no clip.
        """
        folder = self.scene.round_folder(round_index) / "views"
        file = folder / f"{view:03d}" / "path.json"
        if not file.is_file():
            raise SceneError(
                f"round {round_index} has no camera path for view {view}", where=folder,
                cure="Choose another view or round.",
            )  # fmt: skip
        try:
            path = [Camera.from_json(camera) for camera in _json(file)["cameras"]]
            return [path[-1].at(camera.world_from_camera) for camera in path]
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise _damaged(file, f"the field {error} is missing or wrong") from error

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
        file = self.scene.metrics_file
        return _json(file, "Run Evaluate again.") if file.is_file() else {}


def _json(file: Path, cure: str = _CURE) -> dict[str, Any]:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise _damaged(file, "the file cannot be read", cure) from error
    except ValueError as error:
        raise _damaged(file, f"it is not JSON: {error}", cure) from error


def _poses(file: Path) -> np.ndarray:
    """(M, 4, 4) float64 ``world_from_camera``."""
    with opened_arrays(file, SceneError, "it cannot be read", _CURE) as data:
        require_shapes(data, poses="M 4 4")
        require_finite(poses=data["poses"])
        return data["poses"].astype(np.float64)


def _arrays(file: Path, *names: str) -> dict[str, np.ndarray]:
    with opened_arrays(file, SceneError, "it cannot be read", _CURE) as data:
        return {name: data[name] for name in names}


def _require(file: Path, otherwise: str) -> None:
    if not file.is_file():
        raise SceneError(otherwise, where=file, cure="Run Refine first, or choose another round.")


def _damaged(file: Path, what: str, cure: str = _CURE) -> SceneError:
    return SceneError(what, where=file, cure=cure)
