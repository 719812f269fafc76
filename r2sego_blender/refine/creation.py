"""Making a scene bundle from photographs: import, refine and triangulate, register, declare."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..bundle.backends import BACKENDS, WITH_SENSOR
from ..bundle.creating import create_bundle, require_place
from ..bundle.declaration import Declaration
from ..bundle.layout import GROUND_PICTURES
from ..bundle.scene import Scene
from ..captures.archives import is_archive, naming, unpack
from ..captures.blur import relative_sharpness, weights_of
from ..captures.capture import Capture
from ..captures.exposure import exposure_gains_of
from ..captures.frame.depth_scale import depth_scale
from ..captures.frame.ground_picture import save_ground_pictures
from ..captures.frame.lifting import in_photograph
from ..captures.frame.scale import KNOWN_LENGTH, Scale, require_marker
from ..captures.frame.world_frame import register
from ..captures.importing import Choice, import_captures
from ..captures.keyframes.choosing import video_keyframes
from ..captures.masks import FOLDER as MASKS
from ..captures.pose_adjustment import triangulate_refined
from ..captures.poses.dropped_files import VIDEOS
from ..captures.poses.registry import find_export, find_recording, poses_unpacked
from ..captures.sensors.measuring import measured_depth
from ..captures.sensors.sensor_depth import SensorDepth
from ..captures.sensors.sensor_maps import SensorMap
from ..captures.sparse_points import SparsePoints
from ..captures.store import save_captures
from ..config.settings import CaptureSettings
from ..core.errors import CaptureError
from ..core.images import image_files
from ..core.progress import SILENT, Progress
from ..core.scratch import ScratchFolder
from ..robot.controllers.controller import check_controller
from ..robot.model.robot_file import EMBEDDED_HUMANOID
from ..robot.scope.scope import BehaviourScope, shipped_scopes
from .behaviour import DeclaredBehaviour


def create_scene(
    path: Path,
    captures: Path,
    poses: Path | None = None,
    robot: str = EMBEDDED_HUMANOID,
    scope: str = "walk_and_look",
    scale: Scale = Scale.automatic(),
    settings: CaptureSettings = CaptureSettings(),
    progress: Progress = SILENT,
    choice: Choice = Choice(),
) -> Scene:
    """Make the bundle ``path`` from the photographs in the folder or zip ``captures``, or from frames of a video.

    ``poses`` are of any kind in ``captures.poses.formats``; a phone's recording or export brings its own, and
    without any they are solved from the photographs. Of a video, or of a folder without poses that has more,
    ``settings.max_keyframes`` are chosen; ``choice`` chooses otherwise. Everything that can be wrong is looked at
    before the bundle appears: raises CaptureError, RobotError or SceneError and leaves nothing behind.
    """
    path, captures, poses = Path(path), Path(captures), poses and Path(poses)  # scripts give texts, too
    require_place(path)
    if is_archive(captures):
        with ScratchFolder() as unpacked, naming(captures, Path(unpacked), progress) as told:
            folder = unpack(captures, Path(unpacked), told)
            poses = poses or poses_unpacked(folder)
            return create_scene(path, folder, poses, robot, scope, scale, settings, told, choice)
    is_video = captures.is_file() and captures.suffix.lower() in VIDEOS
    recording = find_recording(captures, poses)
    if choice.first and (is_video or recording is not None or choice.names):
        raise CaptureError(
            "the first photographs are asked for, and others",
            where=captures,
            cure="Give --frames, or --first of photographs.",
        )
    if captures.is_file() and captures.suffix.lower() == ".r3d":
        raise CaptureError(
            "Record3D's own recordings are not read",
            where=captures,
            cure="Export it in Record3D as EXR + JPG sequence, and give that folder, or a zip of it.",
        )
    if not (is_video or captures.is_dir()):
        raise CaptureError(
            "there is no such folder", where=captures, cure="Give the folder of photographs, a zip of it, or a video."
        )
    if is_video and poses is not None and recording is None:
        raise CaptureError(
            "poses are of photographs, and these are the frames of a video",
            where=poses,
            cure="Give the folder of the photographs that the poses name; the frames of a video are solved.",
        )
    robot = robot if robot.startswith("embedded:") else str(Path(robot).resolve())
    scope = scope if scope in shipped_scopes() else str(Path(scope).resolve())
    behaviour = DeclaredBehaviour(BehaviourScope.load(scope), robot)
    check_controller(behaviour.model, behaviour.scope)
    for masks in (captures / MASKS, captures.absolute().parent / MASKS):
        if masks.is_dir():
            progress.message(
                f"{masks} is not read: masks of objects go in with `r2sego objects {path} --masks {masks}`"
            )
    if not is_video and recording is None:
        return _create_scene(path, captures, poses, robot, scope, scale, settings, progress, choice)
    video, poses = recording or (captures, None)
    with ScratchFolder() as scratch:  # captures read their frames until the bundle has them
        folder = Path(scratch)
        taken = video_keyframes(video, folder, settings.max_keyframes, progress, choice.names, recording is not None)
        choice = Choice(tuple(one.path.name for one in taken))
        chosen = tuple(map(str, taken))
        return _create_scene(path, folder, poses, robot, scope, scale, settings, progress, choice, video.name, chosen)


def _create_scene(
    path: Path,
    captures: Path,
    poses: Path | None,
    robot: str,
    scope: str,
    scale: Scale,
    settings: CaptureSettings,
    progress: Progress,
    choice: Choice,
    video: str = "",
    chosen: tuple[str, ...] = (),
) -> Scene:
    """``create_scene`` of photographs that lie as files; those of a ``video`` were ``chosen``."""
    _look_over(scale, captures, solved=poses is None and find_export(captures) is None)
    imported = import_captures(captures, poses, settings, progress, choice)
    progress.message(f"{len(imported.captures)} captures: {imported.source}")
    if len(imported.captures) > settings.max_keyframes:
        progress.message(
            f"each takes its time in every step: --keyframes {settings.max_keyframes} takes that many that show most"
        )
    imported, sparse = triangulate_refined(imported, settings, progress)
    registration = register(imported, sparse, scale, settings, progress)
    world_from_capture = registration.world_from_capture
    in_world, sparse_in_world = registration.captures(imported.captures), registration.sparse(sparse)
    measured = _measured(in_world, sparse_in_world, scale, imported.depth, progress)
    in_world = _evened(in_world, sparse_in_world, measured, settings, progress)
    taken = replace(imported, source=f"{imported.source}, frames of {video}") if video else imported
    declaration = Declaration(
        captures_source=taken.described,
        captures_chosen=chosen,
        world_from_capture=tuple(map(tuple, world_from_capture.tolist())),
        ground=registration.ground,
        scale_source=registration.scale_source,
        robot=robot,
        scope=scope,
        backends={**BACKENDS, **(WITH_SENSOR if measured else {})},
    )

    def fill(folder: Path) -> None:
        (folder / "captures").mkdir()
        stored = save_captures(folder / "captures", in_world, sparse_in_world, measured)
        save_ground_pictures(folder / GROUND_PICTURES, stored)

    return create_bundle(path, declaration, fill)


def _measured(
    captures: Sequence[Capture],
    sparse: SparsePoints,
    scale: Scale,
    beside_poses: SensorDepth | None,
    progress: Progress,
) -> dict[str, SensorMap]:
    """What a depth sensor measured of the captures, where one is given or lies beside their poses.

    Its maps count in the world's metres, whatever told these: both are made to agree. Where that cannot be
    said, the maps are not used.
    """
    depth = beside_poses
    if scale.kind == "depth" and scale.folder is not None:
        depth = scale.sensor_depth(beside_poses)
    if depth is None:
        return {}
    try:
        found = depth_scale(captures, sparse, depth)
    except CaptureError as error:
        progress.message(f"the sensor's depth is not used: {error.what}", level="warning")
        return {}
    maps = measured_depth(captures, sparse, depth, found.metres_per_unit, progress)
    share = float(np.mean([(one.depth > 0.0).mean() for one in maps.values()]))
    progress.message(f"depth of a sensor in {len(maps)} of {len(captures)} captures, for {share:.0%} of their pixels")
    return maps


def _evened(
    captures: Sequence[Capture],
    sparse: SparsePoints,
    measured: Mapping[str, SensorMap],
    settings: CaptureSettings,
    progress: Progress,
) -> tuple[Capture, ...]:
    """The captures with their gains and weights, of which those of one exposure, equally sharp, have none."""
    is_wanted = settings.correct_exposure == "auto"
    gains = exposure_gains_of(captures, sparse, measured) if is_wanted else [None] * len(captures)
    if given := [gain for gain in gains if gain is not None]:
        factor = max(max(channel) / min(channel) for channel in zip(*given, strict=True))
        progress.message(
            f"the captures' exposures differ by up to a factor of {factor:.2f}: each is brought to their mean"
        )
    weights = weights_of([capture.name for capture in captures], relative_sharpness(captures, sparse), progress)
    return tuple(
        replace(capture, gain=gain, weight=weight)
        for capture, gain, weight in zip(captures, gains, weights, strict=True)
    )


def _look_over(scale: Scale, folder: Path, solved: bool) -> None:
    """Raise CaptureError where ``scale`` names what is not there: solving poses takes minutes."""
    if scale.kind == "depth" and scale.folder is not None:
        sensor = SensorDepth.beside(scale.folder, scale.unit_m)
        if solved and (names := [path.name for path in image_files(folder)]):
            sensor.require_maps_of(names)
    if scale.kind == "marker" and solved:
        require_marker(image_files(folder), scale)
    if scale.kind == "known_length" and solved:
        files = [(path.name, path) for path in image_files(folder)]
        in_photograph(files, scale.photo, [scale.pixel_a, scale.pixel_b], KNOWN_LENGTH)
