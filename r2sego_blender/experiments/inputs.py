"""What a scene's cells are made of, fixed before anything runs: its captures in their order, and its frozen views."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
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
from ..captures.sensors.sensor_depth import SensorDepth
from ..captures.store import CAPTURES
from ..config.presets import of_captures, with_overrides
from ..core.atomic_files import write_whole
from ..core.digests import content_digest
from ..core.errors import ExperimentError, RobotError
from ..core.images import image_files
from ..core.json_files import read_json
from ..core.progress import SILENT
from ..evaluation.ground_truth import TRUE_MESH
from ..geometry.objects.shapes import require_library
from .plan import Plan, PlannedScene

INPUTS = "inputs.json"
"""The file in an experiment's folder."""

_ANOTHER = "Give another folder with --out, or put back what was there when this experiment began."

Files = tuple[tuple[str, str], ...]
"""Photographs in their order: name and SHA-256."""


@dataclass(frozen=True)
class SceneInputs:
    """The digests of a scene's captures, poses and frozen views, and how they are imported.

    ``frozen_sha256`` is of the whole list: names, photographs, lenses and poses in their order. ``others`` are the
    digests of what else decides the scores, by what it is, of what is there: files of robot and scope, the true room,
    what an import reads beside photographs and poses, and what a bundle was made with.
    """

    captures: Files
    poses: str
    frozen: Files
    frozen_sha256: str
    options: Mapping[str, Any]
    others: Mapping[str, str] = field(default_factory=dict)


def fixed_inputs(plan: Plan, folder: Path, write: bool = True) -> dict[str, SceneInputs]:
    """The inputs of each of the plan's scenes by its name, as they were when each was first asked for.

    What is new is added to the experiment's ``folder``, where something may be written. Raises ExperimentError
    for captures, poses or frozen views that have changed since, for a frozen view that is among the captures, for
    poses of frozen views where those of the captures are solved, and for counts that a scene has not; CaptureError for
    what cannot be read.
    """
    found = {scene.name: _inputs(scene, max(plan.counts, default=0)) for scene in plan.scenes}
    file = folder / INPUTS
    known = known_inputs(file)
    for name, one in found.items():
        present = _as_json(one)
        if name in known and known[name] != present:
            changed = next(key for key in {**present, **known[name]} if known[name].get(key) != present.get(key))
            raise ExperimentError(f"{changed} of the scene {name} are not as they were", where=file, cure=_ANOTHER)
    if write and any(name not in known for name in found):
        scenes = known | {name: _as_json(one) for name, one in found.items()}
        write_whole(file, json.dumps({"version": __version__, "scenes": scenes}, indent=1) + "\n")
    return found


def frozen_digest(frozen: Path) -> str:
    """The digest of a list of frozen views as it is now."""
    return _frozen(frozen)[2]


def _inputs(scene: PlannedScene, most: int) -> SceneInputs:
    captures, poses, cameras, others = _captures(scene)
    if len(captures) < most:
        raise ExperimentError(
            f"the scene {scene.name} has {len(captures)} captures, and {most} are asked for",
            where="counts",
            cure="Take counts beyond that away.",
        )
    frozen, views, sha256 = _frozen(scene.frozen)
    solved = Scene.open(scene.captures).declaration.poses_solved if scene.is_bundle else not poses
    if views and solved:
        raise ExperimentError(
            f"the poses of the scene {scene.name} are solved, and those of its frozen views are in another frame",
            where=scene.frozen,
            cure="Give the folder of the held-out photographs, or poses of both.",
        )
    _require_distinct(scene, captures[: most or None], cameras[: most or None], frozen, views)
    options: dict[str, Any] = {"robot": scene.robot, "scope": scene.scope, "camera_height": scene.camera_height}
    options["overrides"] = dict(scene.overrides)
    true_room = [content_digest(folder / TRUE_MESH) for folder in (scene.frozen, scene.frozen.parent)]
    others = {**_behaviour(scene.robot, scene.scope), **others, "true_room": _digest_of_any(true_room)}
    there = {what: digest for what, digest in others.items() if digest}
    return SceneInputs(captures, poses, frozen, sha256, options, there)


def _captures(scene: PlannedScene) -> tuple[Files, str, Sequence[np.ndarray], Mapping[str, str]]:
    """A scene's captures, the digest of their poses, these (4, 4), none where they are to be solved, and the digests
    of what else they are imported or were made with, '' of what is not there."""
    if scene.is_bundle:
        bundle = Scene.open(scene.captures)
        declared, parts = bundle.declaration, (*IN_WORLD_FRAME, ESTIMATES)
        made_of = [content_digest(bundle.path / part) for part in parts]
        made_of += [declared.robot, declared.scope, declared.mesh_library]
        files = _digests((one.name, one.image_path) for one in bundle.read(CAPTURES))
        kept = sorted(of_captures(declared.overrides).items())
        library = ""
        if declared.mesh_library:
            require_library(Path(declared.mesh_library))
            library = content_digest(Path(declared.mesh_library))
        others = {"import_settings": _digest_of_any(kept), "mesh_library": library}
        return files, _digest(made_of), (), {**others, **_behaviour(declared.robot, declared.scope)}
    if not scene.captures.is_dir():
        cure = "Name a folder of photographs, or a bundle."
        raise ExperimentError(f"the scene {scene.name} is not there", where=scene.captures, cure=cure)
    found = find_poses(scene.poses) if scene.poses else find_export(scene.captures)
    if found is None:
        return _digests((path.name, path) for path in plain_photographs(scene.captures, SILENT)), "", (), {}
    record, place = found
    posed = record.read(place, scene.captures, with_overrides(dict(scene.overrides)).captures, SILENT)
    poses = [photograph.world_from_camera for photograph in posed.photographs]
    masks = [content_digest(one.mask_path) for one in posed.photographs if one.mask_path]
    points = None if place.is_dir() or record.points is None else record.points(place, SILENT)
    others = {"sensor_depth": _of_sensor(posed.depth), "masks": _digest_of_any(masks)}
    others["points"] = "" if points is None else hashlib.sha256(b"".join(map(np.ndarray.tobytes, points))).hexdigest()
    return _digests((one.name, one.path) for one in posed.photographs), content_digest(place), poses, others


def _of_sensor(depth: SensorDepth | None) -> str:
    """The digest of the sensor's maps; '' without any."""
    if depth is None:
        return ""
    named = sorted([*depth.files.items(), *depth.confidence_files.items()])
    places = [place for _, place in named] or [depth.folder, *([depth.confidence] if depth.confidence else [])]
    return _digest([content_digest(place) for place in places])


def _behaviour(robot: str, scope: str) -> dict[str, str]:
    """The digests of a robot and a scope with all that their files name; '' where they are no files."""
    of_robot, of_scope = "", list[str]()
    if Path(robot).is_file():
        from ..robot.model.robot_file import robot_digest  # MuJoCo takes a second

        of_robot = robot_digest(robot) or content_digest(Path(robot))
    if Path(scope).is_file():
        from ..robot.scope.scope import BehaviourScope

        of_scope = [content_digest(Path(scope))]
        with contextlib.suppress(RobotError):  # cells say what is wrong with it
            of_scope += map(content_digest, BehaviourScope.load(scope).files)
    return {"robot": of_robot, "scope": _digest_of_any(of_scope)}


def _digest_of_any(values: Sequence[Any]) -> str:
    """The digest of a list of JSON values; '' where there are none but empty ones."""
    return _digest(values) if any(values) else ""


def _digest(value: Any) -> str:
    """The digest of a JSON value."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


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
    return files, views, _digest([files, seen])


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
    """As the file has it: ``others`` by their names beside the rest, so that what changed is named."""
    found: dict[str, Any] = json.loads(json.dumps(asdict(inputs)))
    found.update(found.pop("others"))
    return found
