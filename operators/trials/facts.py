"""What a study's folder held when it was read: on purpose, as it is opened and as a trial ends."""

from dataclasses import dataclass
from pathlib import Path

import bpy

from ...r2sego_blender.bridge.shared.moved_bundle import whole_path
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.trials.plan.next_trial import Ended, next_trial
from ...r2sego_blender.trials.plan.study import StudyState, state_of
from ...r2sego_blender.trials.plan.trial_plan import PlannedTrial, TrialPlan
from ...r2sego_blender.trials.records.index import RecordIndex


@dataclass(frozen=True)
class StudyFacts:
    """The plan, whether it has begun and was ended, and the trial that comes next; or what is wrong."""

    plan: TrialPlan | None = None
    state: StudyState = StudyState()
    next: PlannedTrial | None = None
    problem: str = ""


_kept: dict[str, StudyFacts] = {}
"""By the study's whole path."""


def study_path(scene: bpy.types.Scene) -> str:
    """The whole path of the study that is open in a Blender scene, '' where none is."""
    return whole_path(scene.r2sego_trials.study)


def of(scene: bpy.types.Scene) -> StudyFacts:
    """What is known of the open study; nothing where none is open, or it was not read."""
    return _kept.get(study_path(scene), StudyFacts())


def read(study: str) -> StudyFacts:
    """Read a study's folder again; what cannot be read is told as the ``problem``."""
    try:
        plan = TrialPlan.load(study)
        _kept[study] = StudyFacts(plan, state_of(study), next_trial(plan, _ended(study)))
    except (R2SEgoError, OSError) as error:
        _kept[study] = StudyFacts(problem=str(error))
    redraw_views("UI")
    return _kept[study]


def forget() -> None:
    """Know of no study."""
    _kept.clear()


@bpy.app.handlers.persistent
def read_again(*_: object) -> None:
    """Read the studies that a loaded file names: they may be further than what is known of them."""
    for study in filter(None, map(study_path, bpy.data.scenes)):
        read(study)


@bpy.app.handlers.persistent
def catch_up(*_: object) -> None:
    """Read the studies that undo has brought back and that are not known yet."""
    for study in filter(None, map(study_path, bpy.data.scenes)):
        if study not in _kept:
            read(study)


def _ended(study: str) -> list[Ended]:
    """What every trial of the study that was run ended in."""
    return [entry.ended for entry in RecordIndex(Path(study)).entries()]
