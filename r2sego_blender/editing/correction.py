"""Correcting where a scene's floor lies, which way is up and how long a metre is."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..bundle import layout
from ..bundle.layout import SCOPE_FILE
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.frame.correction_history import corrections_of
from ..captures.frame.floor_points import FloorPoint, ground_of, ground_through
from ..captures.frame.ground import Ground
from ..captures.frame.ground_picture import save_ground_pictures
from ..captures.frame.picks import Picks
from ..captures.frame.picks_fit import PicksFit, fit_picks
from ..captures.frame.scale import Scale
from ..captures.frame.world_frame import Registration, corrected
from ..captures.sensors.sensor_maps import SENSOR_DEPTH
from ..captures.sparse_points import FARTHEST_M, SPARSE, SparsePoints
from ..captures.store import CAPTURES, save_captures
from ..core.digests import content_digest
from ..core.errors import CaptureError
from ..core.json_files import write_json
from ..core.progress import SILENT, Progress
from ..geometry.objects.objects import OBJECTS
from ..geometry.proxy.edits import PROXY_EDITS
from ..robot.scope.scope import BehaviourScope
from ..robot.scope.scope_file import moved_scope, save_scope
from ..splats.asset_edits import ASSET_EDITS, move_edits
from .object_priors import move_objects
from .proxy_edits import move_proxy_edits


def correct_registration(
    scene: Scene,
    *,
    floor: Sequence[FloorPoint] = (),
    up: Sequence[float] | None = None,
    floor_at_m: float | None = None,
    scale: Scale | None = None,
    progress: Progress = SILENT,
) -> Scene:
    """Move the scene to another world frame by one similarity; returns the scene as declared then.

    The ground goes through the points ``floor``, or has the direction ``up`` and lies
    ``floor_at_m`` above z = 0, both as the world is now; pixels of ``floor`` and ``scale``
    are those of the bundle's images. Captures, sparse points and the declaration are moved
    together, and every step that reads them redoes itself on the next run. Raises
    CaptureError when the ground or the scale cannot be told, and changes nothing then.
    """
    by_hand = up is not None or floor_at_m is not None
    if (floor and by_hand) or not (floor or by_hand or scale):
        raise CaptureError(
            "the ground is given twice" if floor else "nothing is to be corrected",
            where=scene.path,
            cure="Give points of the floor, or the direction up and where the floor lies, or a scale.",
        )
    with scene.locked():
        scene, captures, sparse = _load(scene)
        ground = None
        if floor:
            ground = ground_through(captures, sparse, floor, progress)
        elif by_hand:
            ground = ground_of(captures, up, floor_at_m or 0.0)
        after, similarity = corrected(_registration(scene), captures, sparse, ground, scale, progress)
        return _moved(scene, captures, sparse, similarity, after)


def correct_by_picks(scene: Scene, picks: Picks, progress: Progress = SILENT) -> tuple[Scene, PicksFit]:
    """Move the scene to the ground and the scale that fit a person's picks best.

    Returns the scene as declared then, and the fit with its residuals. Raises CaptureError when
    the picks tell neither, or contradict each other, and changes nothing then.
    """
    with scene.locked():
        scene, captures, sparse = _load(scene)
        fit = fit_picks(picks, captures, sparse, progress)
        fit.check()
        if fit.ground is None and fit.metres_per_unit is None:
            raise CaptureError(
                "the picks tell neither the floor nor a scale",
                where=scene.path,
                cure="Mark points as floor, or give the length between two points or a camera's height.",
            )
        scale = None
        if fit.metres_per_unit is not None:
            scale = Scale.measured(fit.metres_per_unit, fit.scale_source)
        after, similarity = corrected(_registration(scene), captures, sparse, fit.ground, scale, progress)
        return _moved(scene, captures, sparse, similarity, after), fit


def correct_to_frame(scene: Scene, world_from_frame: np.ndarray) -> Scene:
    """Make a frame that a person placed the world; returns the scene as declared then.

    ``world_from_frame`` (4, 4) is the frame's pose in the world of now; where it has a uniform
    scale s, s metres of now become one. The origin and the heading are then the frame's own.
    Raises CaptureError, and changes nothing, for no similarity and where cameras would lie below.
    """
    frame = np.asarray(world_from_frame, np.float64)
    scale = _scale_of(frame)
    with scene.locked():
        scene, captures, sparse = _load(scene)
        similarity = np.linalg.inv(frame)
        up = frame[:3, 2] / scale
        ground = Ground(up, float(up @ frame[:3, 3]), 0, True, "the plane of a frame placed by hand")
        lowest = min(captures, key=lambda capture: float(ground.height(capture.camera.centre)))
        if not ground.height(lowest.camera.centre) > 0:
            raise CaptureError(
                f"the frame's plane would lie above the camera of {lowest.name}",
                where="frame",
                cure="Move the frame down onto the floor, its z-axis up.",
            )
        before = _registration(scene)
        source = before.scale_source
        if abs(scale - 1.0) > 1e-6:
            source += f"; then a metre became {1.0 / scale:.4g} m by hand"
        after = Registration(similarity @ before.world_from_capture, ground.description, source)
        return _moved(scene, captures, sparse, similarity, after)


def undo_correction(scene: Scene) -> Scene:
    """Take the last correction back; returns the scene as declared then.

    What the correction moved and nobody changed since is to the bit as it was before it, so that
    steps that have not run meanwhile need not run again. Raises CaptureError when no correction is
    left to take back.
    """
    with scene.locked():
        history = corrections_of(scene.path)
        if not history:
            raise CaptureError("there is no correction to take back", where=scene.path)
        last = history[-1]
        before = Registration(np.array(last["world_from_capture"]), last["ground"], last["scale_source"])
        similarity = np.linalg.inv(np.array(last["new_from_old"]))
        return _moved(*_load(scene), similarity, before, taken_back=True)


def _moved(
    scene: Scene,
    captures: Sequence[Capture],
    sparse: SparsePoints,
    similarity: np.ndarray,
    after: Registration,
    taken_back: bool = False,
) -> Scene:
    """The scene carried over by one similarity, that of a correction or of one taken back, and declared."""
    history = corrections_of(scene.path)
    last = history.pop() if taken_back else {}
    number = len(history)
    points = sparse.transformed(similarity)
    moved = [capture.transformed(similarity) for capture in captures]
    _require_room_sized(points, moved)
    # Read before anything is written: what is damaged is named by its place in the scene.
    scene.read(OBJECTS).of(captures)
    scene.read(PROXY_EDITS)
    scene.read(ASSET_EDITS)
    given = BehaviourScope.load(scene.declaration.scope)
    own_scope = (scene.path / SCOPE_FILE).absolute()
    scope = moved_scope(given, similarity, own_scope)
    with scene.corrected() as new:
        measured = scene.read(SENSOR_DEPTH)
        found = {capture.name: measured.found(captures, index) for index, capture in enumerate(captures)}
        of_sensor = {name: one.transformed(similarity) for name, one in found.items() if one is not None}
        with new.publishing(layout.CAPTURES) as folder:
            # What others keep there, such as masks, does not depend on the frame.
            shutil.copytree(scene.captures_folder, folder, dirs_exist_ok=True)
            save_captures(folder, moved, points, of_sensor)
        for edited in layout.EDITED:
            if (scene.path / edited).is_dir():
                shutil.copytree(scene.path / edited, new.path / edited)
        move_objects(new, similarity)
        move_proxy_edits(new, similarity)
        move_edits(new, similarity)
        source = scene.name_of(scene.declaration.scope)
        if scope != given:
            source = SCOPE_FILE
            with new.publishing(SCOPE_FILE) as file:
                save_scope(scope, file)
        if taken_back:
            made = {}
            _restore(scene.path, new.path, number, last["made"])
        else:
            made = _changed(scene.path, new.path)
            history.append(_remembered(_registration(scene), similarity, made))
        _keep_what_was_before(scene, new, number, made)
        with new.publishing(layout.CORRECTIONS) as file:
            write_json(file, history)
        with new.publishing(layout.GROUND_PICTURES) as folder:
            save_ground_pictures(folder, new.read(CAPTURES))
        new.declare(
            scope=source,
            world_from_capture=tuple(map(tuple, after.world_from_capture.tolist())),
            ground=after.ground,
            scale_source=after.scale_source,
        )
    return Scene.open(scene.path)


def _require_room_sized(points: SparsePoints, captures: Sequence[Capture]) -> None:
    places = (points.points, *(one.camera.centre for one in captures))
    farthest = max(float(np.abs(each).max(initial=0.0)) for each in places)
    if not farthest <= FARTHEST_M:
        raise CaptureError(
            f"a point would lie {farthest:.0e} m away", where="the new scale", cure="Give the scale of a room."
        )


def _keep_what_was_before(scene: Scene, new: Scene, number: int, made: Iterable[str]) -> None:
    """In ``new``, what so many earlier corrections replaced, and what this one does, ``made`` by their names."""
    kept = scene.path / layout.BEFORE_CORRECTIONS
    with new.publishing(layout.BEFORE_CORRECTIONS) as folder:
        for earlier in range(number):
            if (kept / str(earlier)).is_dir():
                shutil.copytree(kept / str(earlier), folder / str(earlier))
        for name in made:
            _copy(scene.path / name, folder / str(number) / name)


def _remembered(before: Registration, similarity: np.ndarray, made: Mapping[str, str]) -> dict[str, Any]:
    """A correction as the history has it: the registration before it, and the digests of what it made."""
    return {
        "new_from_old": similarity.tolist(),
        "world_from_capture": before.world_from_capture.tolist(),
        "ground": before.ground,
        "scale_source": before.scale_source,
        "made": dict(made),
    }


def _changed(old: Path, new: Path) -> dict[str, str]:
    """The digests of ``new``'s files that are others in ``old``, by their names."""
    names = [file.relative_to(new).as_posix() for file in sorted(new.rglob("*")) if file.is_file()]
    made = {name: content_digest(new / name) for name in names if (old / name).is_file()}
    return {name: digest for name, digest in made.items() if digest != content_digest(old / name)}


def _restore(old: Path, new: Path, number: int, made: Mapping[str, str]) -> None:
    """Put back in ``new`` what correction ``number`` changed, where ``old`` still has what it made."""
    kept = old / layout.BEFORE_CORRECTIONS / str(number)
    for before in sorted(kept.rglob("*")):
        name = before.relative_to(kept).as_posix()
        if (new / name).is_file() and content_digest(old / name) == made.get(name):
            _copy(before, new / name)


def _copy(file: Path, place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy2(file, place)


def _load(scene: Scene) -> tuple[Scene, tuple[Capture, ...], SparsePoints]:
    """What is moved, and the scene as it is declared now: it may have been corrected since it was opened."""
    captures = scene.read(CAPTURES)
    return Scene.open(scene.path), captures, scene.read(SPARSE)


def _registration(scene: Scene) -> Registration:
    declared = scene.declaration
    return Registration(np.array(declared.world_from_capture), declared.ground, declared.scale_source)


def _scale_of(frame: np.ndarray) -> float:
    """The uniform scale of a (4, 4) similarity. Raises CaptureError when it is none."""
    if frame.shape == (4, 4) and np.isfinite(frame).all() and np.linalg.det(frame[:3, :3]) > 0:
        scale = float(np.cbrt(np.linalg.det(frame[:3, :3])))
        rotation = frame[:3, :3] / scale
        if np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) and np.allclose(frame[3], [0, 0, 0, 1]):
            return scale
    raise CaptureError(
        "the frame is no pose with one scale",
        where="frame",
        cure="Move, turn and scale it as a whole, without mirroring or shearing.",
    )
