"""Making a scene bundle from photographs: import, refine and triangulate, register, declare."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..bundle.backends import BACKENDS, WITH_SENSOR
from ..bundle.creating import create_bundle, require_place
from ..bundle.declaration import Declaration
from ..bundle.layout import GROUND_PICTURES
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.frame.depth_scale import depth_scale
from ..captures.frame.ground_picture import save_ground_pictures
from ..captures.frame.lifting import in_photograph
from ..captures.frame.scale import KNOWN_LENGTH, Scale, require_marker
from ..captures.frame.world_frame import register
from ..captures.importing import import_captures
from ..captures.masks import FOLDER as MASKS
from ..captures.pose_adjustment import triangulate_refined
from ..captures.poses.registry import find_export
from ..captures.sensors.measuring import measured_depth
from ..captures.sensors.sensor_depth import SensorDepth
from ..captures.sensors.sensor_maps import SensorMap
from ..captures.sparse_points import SparsePoints
from ..captures.store import save_captures
from ..config.settings import CaptureSettings
from ..core.errors import CaptureError
from ..core.images import image_files
from ..core.progress import SILENT, Progress
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
) -> Scene:
    """Make the bundle ``path`` from the photographs in the folder ``captures``.

    ``poses`` is a transforms.json, a cameras.json, a COLMAP folder or a raw export of Polycam;
    without it the poses are solved from the photographs. Everything that can be wrong is looked
    at before the bundle appears: raises CaptureError, RobotError or SceneError and leaves nothing behind.
    """
    path, captures, poses = Path(path), Path(captures), poses and Path(poses)  # scripts give texts, too
    require_place(path)
    if not captures.is_dir():
        raise CaptureError("there is no such folder", where=captures, cure="Give the folder of photographs.")
    robot = robot if robot.startswith("embedded:") else str(Path(robot).resolve())
    scope = scope if scope in shipped_scopes() else str(Path(scope).resolve())
    behaviour = DeclaredBehaviour(BehaviourScope.load(scope), robot)
    check_controller(behaviour.model, behaviour.scope)

    _look_over(scale, captures, solved=poses is None and find_export(captures) is None)
    for masks in (captures / MASKS, captures.absolute().parent / MASKS):
        if masks.is_dir():
            progress.message(
                f"{masks} is not read: masks of objects go in with `r2sego objects {path} --masks {masks}`"
            )
    imported = import_captures(captures, poses, settings, progress)
    progress.message(f"{len(imported.captures)} captures: {imported.source}")
    imported, sparse = triangulate_refined(imported, settings, progress)
    registration = register(imported, sparse, scale, settings, progress)
    world_from_capture = registration.world_from_capture
    in_world, sparse_in_world = registration.captures(imported.captures), registration.sparse(sparse)
    measured = _measured(in_world, sparse_in_world, scale, imported.depth, progress)
    declaration = Declaration(
        captures_source=imported.source,
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


def _look_over(scale: Scale, folder: Path, solved: bool) -> None:
    """Raise CaptureError where ``scale`` names what is not there: solving poses takes minutes."""
    if scale.kind == "depth" and scale.folder is not None:
        SensorDepth.beside(scale.folder, scale.unit_m)
    if scale.kind == "marker" and solved:
        require_marker(image_files(folder), scale)
    if scale.kind == "known_length" and solved:
        files = [(path.name, path) for path in image_files(folder)]
        in_photograph(files, scale.photo, [scale.pixel_a, scale.pixel_b], KNOWN_LENGTH)
