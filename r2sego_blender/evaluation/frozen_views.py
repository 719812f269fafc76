"""The frozen views of a scene, and whether they stand apart from all that its refinement was shown.

They are read for scoring alone, after the refinement; nothing of them flows back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..captures.capture import Capture, DecodedCapture
from ..captures.frozen import load_frozen_views
from ..captures.held_out_poses import adjusted_views
from ..captures.solving.locating import locate_views
from ..captures.sparse_points import SPARSE
from ..captures.store import CAPTURES
from ..core.cameras import Camera, rotation_angle_rad
from ..core.errors import EvaluationError
from ..core.progress import SILENT, Progress
from ..generation.ego_views import VIEWS
from ..generation.view_records import read_views
from ..geometry.stereo.stereo import DEPTH
from ..views.selection import SELECTION

_SAME_PLACE_M, _SAME_TURN_RAD = 0.005, 0.005
"""Poses of one photograph that were found twice differ by as much, such as given and located ones."""


class PosedViews(NamedTuple):
    """Frozen views in the world frame, and in words how their given poses were refined; "" where they are as given."""

    views: tuple[Capture, ...]
    refined: str


def frozen_views(scene: Scene, frozen: Path, progress: Progress = SILENT) -> PosedViews:
    """The frozen views of ``frozen``: a cameras.json, of which the frozen list alone is read, whose poses are judged by
    the captures as those of the captures were, or a folder of held-out photographs, which are located against these.

    Raises EvaluationError for poses where those of the captures were solved: their frames are two.
    """
    captures, h = scene.read(CAPTURES), scene.declaration.settings
    if frozen.is_dir():
        maps = scene.read(DEPTH).of(captures)
        depths = [np.where(m.reliable(h.stereo), m.depth, 0.0) for m in maps]
        sparse = scene.read(SPARSE)
        located = locate_views(frozen, captures, sparse, h.captures, depths=depths, seed=h.seed, progress=progress)
        return PosedViews(located, "")
    if scene.declaration.poses_solved:
        raise EvaluationError(
            "the captures' poses were solved, and those that are given here are in another frame",
            where=frozen,
            cure="Give the folder of the held-out photographs: they are located against the captures.",
        )
    world_from_capture = np.array(scene.declaration.world_from_capture)
    given = [view.transformed(world_from_capture) for view in load_frozen_views(frozen, captures=captures)]
    views, refined = adjusted_views(given, captures, h.captures, progress)
    if refined:
        progress.message(f"held-out {refined}")
    return PosedViews(views, refined)


def views_to_score(scene: Scene, frozen: Path, distinct: bool, progress: Progress = SILENT) -> PosedViews:
    """The frozen views, decoded once for all arms and rounds; those that were trained on are told.

    Raises EvaluationError for one of them where views are to be ``distinct`` (``require_distinct``).
    """
    posed = frozen_views(scene, frozen, progress)
    views = tuple(map(DecodedCapture.of, posed.views))
    if distinct:
        require_distinct(scene, views)
    if seen := seen_in_training(scene, views):
        progress.message(
            f"{', '.join(seen)}: taken from where a capture was; scores of what was trained on say little", "warning"
        )
    return PosedViews(views, posed.refined)


def poses_lines(metrics: Mapping[str, Any]) -> list[str]:
    """How the frozen views' poses were refined, as lines for a terminal."""
    return [f"their {poses}"] if (poses := metrics.get("frozen_poses")) else []


def same_view(one: Camera, other: Camera) -> bool:
    """Whether two cameras of one world in metres stand and look as one photograph's do."""
    return bool(
        np.linalg.norm(one.centre - other.centre) < _SAME_PLACE_M
        and rotation_angle_rad(one.world_from_camera, other.world_from_camera) < _SAME_TURN_RAD
    )


def seen_in_training(scene: Scene, views: Sequence[Capture]) -> list[str]:
    """The names of the views that stand and look as a capture does."""
    captures = [capture.camera for capture in scene.read(CAPTURES)]
    return [view.name for view in views if any(same_view(view.camera, camera) for camera in captures)]


def require_distinct(scene: Scene, views: Sequence[Capture]) -> None:
    """Raises EvaluationError naming the views that stand and look as a capture or a retained target does.

    A target counts at the pose that was asked for, and at the one where its frame was registered.
    """
    shown = [*_captures(scene), *_retained_targets(scene)]
    same = [f"{view.name} is {name}" for view in views for name, camera in shown if same_view(view.camera, camera)]
    if same:
        raise EvaluationError(
            f"frozen views are among what was trained on: {', '.join(same)}",
            where=scene.path,
            cure="Hold out views that are neither captures nor targets.",
        )


def _captures(scene: Scene) -> Iterator[tuple[str, Camera]]:
    for capture in scene.read(CAPTURES):
        yield f"the capture {capture.name}", capture.camera


def _retained_targets(scene: Scene) -> Iterator[tuple[str, Camera]]:
    for index in range(scene.newest_round("asset.ply") + 1):
        selection, candidates = scene.read(SELECTION.of_round(index))
        for record in read_views(scene.path / of_round(index, "views"), selection.budget):
            if record.accepted:
                yield f"the target {record.rank} of round {index}", candidates[record.candidate]
        for view in scene.read(VIEWS.of_round(index)):
            yield f"the generated view {view.rank} of round {index}", view.camera
