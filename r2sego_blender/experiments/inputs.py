"""What a scene's cells are made of, fixed before anything runs: its captures in their order, and its frozen views."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..bundle.layout import ESTIMATES, IN_WORLD_FRAME
from ..bundle.scene import Scene
from ..captures.poses.cameras_json import read_frozen
from ..captures.poses.photographs import Photograph
from ..captures.poses.plain_folder import plain_photographs
from ..captures.poses.registry import find_export, find_poses
from ..captures.store import CAPTURES
from ..config.presets import with_overrides
from ..core.atomic_files import write_whole
from ..core.digests import content_digest
from ..core.errors import ExperimentError
from ..core.images import image_files
from ..core.json_files import read_json
from ..core.progress import SILENT
from .plan import Plan, PlannedScene

INPUTS = "inputs.json"
"""The file in an experiment's folder."""

_ANOTHER = "Give another folder with --out, or put back what was there when this experiment began."

Files = tuple[tuple[str, str], ...]
"""Photographs in their order: name and SHA-256."""


@dataclass(frozen=True)
class SceneInputs:
    """The digests of a scene's captures, poses and frozen views, and how they are imported.

    ``frozen_sha256`` is of the whole list: names, photographs, lenses and poses in their order.
    """

    captures: Files
    poses: str
    frozen: Files
    frozen_sha256: str
    options: Mapping[str, Any]


def fixed_inputs(plan: Plan, folder: Path, write: bool = True) -> dict[str, SceneInputs]:
    """The inputs of each of the plan's scenes by its name, as they were when each was first asked for.

    What is new is added to the experiment's ``folder``, where something may be written. Raises ExperimentError
    for captures, poses or frozen views that have changed since, for a frozen view that is among the captures, and
    for counts that a scene has not; CaptureError for what cannot be read.
    """
    found = {scene.name: _inputs(scene, max(plan.counts, default=0)) for scene in plan.scenes}
    file = folder / INPUTS
    known = known_inputs(file)
    for name, one in found.items():
        present = _as_json(one)
        if name in known and known[name] != present:
            changed = next(key for key in present if known[name].get(key) != present[key])
            raise ExperimentError(f"{changed} of the scene {name} are not as they were", where=file, cure=_ANOTHER)
    if write and any(name not in known for name in found):
        scenes = known | {name: _as_json(one) for name, one in found.items()}
        write_whole(file, json.dumps({"version": __version__, "scenes": scenes}, indent=1) + "\n")
    return found


def frozen_digest(frozen: Path) -> str:
    """The digest of a list of frozen views as it is now."""
    return _frozen(frozen)[2]


def _inputs(scene: PlannedScene, most: int) -> SceneInputs:
    captures, poses, cameras = _captures(scene)
    if len(captures) < most:
        raise ExperimentError(
            f"the scene {scene.name} has {len(captures)} captures, and {most} are asked for",
            where="counts",
            cure="Take counts beyond that away.",
        )
    frozen, views, sha256 = _frozen(scene.frozen)
    _require_distinct(scene, captures[: most or None], cameras[: most or None], frozen, views)
    options = {"robot": scene.robot, "scope": scene.scope, "camera_height": scene.camera_height}
    return SceneInputs(captures, poses, frozen, sha256, {**options, "overrides": dict(scene.overrides)})


def _captures(scene: PlannedScene) -> tuple[Files, str, Sequence[np.ndarray]]:
    """A scene's captures, the digest of their poses, and these (4, 4), none where they are to be solved."""
    if scene.is_bundle:
        bundle = Scene.open(scene.captures)
        declared, parts = bundle.declaration, (*IN_WORLD_FRAME, ESTIMATES)
        made_of = [content_digest(bundle.path / part) for part in parts]
        made_of += [declared.robot, declared.scope, declared.mesh_library]
        files = _digests((one.name, one.image_path) for one in bundle.read(CAPTURES))
        return files, hashlib.sha256(json.dumps(made_of).encode()).hexdigest(), ()
    if not scene.captures.is_dir():
        cure = "Name a folder of photographs, or a bundle."
        raise ExperimentError(f"the scene {scene.name} is not there", where=scene.captures, cure=cure)
    found = find_poses(scene.poses) if scene.poses else find_export(scene.captures)
    if found is None:
        return _digests((path.name, path) for path in plain_photographs(scene.captures, SILENT)), "", ()
    record, place = found
    posed = record.read(place, scene.captures, with_overrides(dict(scene.overrides)).captures, SILENT)
    poses = [photograph.world_from_camera for photograph in posed.photographs]
    return _digests((one.name, one.path) for one in posed.photographs), content_digest(place), poses


def _frozen(frozen: Path) -> tuple[Files, Sequence[Photograph], str]:
    """The frozen views, those with poses as photographs, and the digest of the list."""
    if frozen.is_dir():
        files = _digests((path.name, path) for path in image_files(frozen))
        views: list[Photograph] = []
    else:
        views = read_frozen(frozen, frozen.parent)
        files = _digests((view.name, view.path) for view in views)
    if not files:
        raise ExperimentError("there are no frozen views", where=frozen, cure="Hold photographs out, and name them.")
    seen = [[asdict(view.lens), np.asarray(view.world_from_camera, float).tolist()] for view in views]
    return files, views, hashlib.sha256(json.dumps([files, seen], sort_keys=True).encode()).hexdigest()


def _digests(files: Iterator[tuple[str, Path]]) -> Files:
    return tuple((name, content_digest(path)) for name, path in files)


def _require_distinct(
    scene: PlannedScene, captures: Files, poses: Sequence[np.ndarray], frozen: Files, views: Sequence[Photograph]
) -> None:
    """Raises ExperimentError for a frozen view with a capture's picture or pose.

    Evaluating a cell looks again, in metres, and at its targets, too.
    """
    pictures = {digest: name for name, digest in captures}
    same = {name: pictures[digest] for name, digest in frozen if digest in pictures}
    for view in views:
        for (name, _), pose in zip(captures, poses, strict=False):
            if np.allclose(view.world_from_camera, pose, rtol=0.0, atol=1e-6):
                same[view.name] = name
    if same:
        named = ", ".join(f"{view} is {name}" for view, name in same.items())
        raise ExperimentError(
            f"frozen views of the scene {scene.name} are among its captures: {named}",
            where=scene.frozen,
            cure="Hold out views that are no captures.",
        )


def known_inputs(file: Path) -> dict[str, Any]:
    """The scenes of an experiment that was begun, as its file has them. Raises ExperimentError."""
    try:
        data = read_json(file)
        if not (isinstance(data["scenes"], dict) and all(isinstance(one, dict) for one in data["scenes"].values())):
            raise ValueError("it lists no scenes")
        version, scenes = str(data["version"]), dict(data["scenes"])
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ExperimentError(f"this file is damaged: {error}", where=file, cure=_ANOTHER) from error
    if version != __version__:
        raise ExperimentError(
            f"this experiment was begun with version {version}, and this is {__version__}",
            where=file,
            cure="Go on with that version, or give another folder with --out.",
        )
    return scenes


def _as_json(inputs: SceneInputs) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(json.dumps(asdict(inputs)))
    return found
