"""Frozen views apart from all that a refinement was shown: its captures, and its retained targets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..bundle.layout import of_round
from ..bundle.scene import Scene
from ..captures.capture import Capture
from ..captures.store import CAPTURES
from ..core.cameras import Camera, rotation_angle_rad
from ..core.errors import EvaluationError
from ..generation.ego_views import VIEWS
from ..generation.view_records import read_views
from ..views.selection import SELECTION

_SAME_PLACE_M, _SAME_TURN_RAD = 0.005, 0.005
"""Poses of one photograph that were found twice differ by as much, such as given and located ones."""


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
    for index in range(scene.rounds_of_result()):
        selection, candidates = scene.read(SELECTION.of_round(index))
        for record in read_views(scene.path / of_round(index, "views"), selection.budget):
            if record.accepted:
                yield f"the target {record.rank} of round {index}", candidates[record.candidate]
        for view in scene.read(VIEWS.of_round(index)):
            yield f"the generated view {view.rank} of round {index}", view.camera
