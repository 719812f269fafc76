"""Show where robot and chair stand for a trial."""

from pathlib import Path

import bpy
from bpy.props import IntProperty

from ...r2sego_blender.bridge.trials.show_poses import show_poses
from ...r2sego_blender.core.errors import TrialError
from ...r2sego_blender.trials.plan.trial_plan import PlannedTrial
from ..base import ReportingOperator, hint_if_hidden
from . import facts
from .polls import needs_study
from .session import live_of, trial_name


class R2SEGO_OT_show_trial_poses(ReportingOperator, bpy.types.Operator):
    """Show on the floor where robot and chair stand for a trial; during a session they follow it"""

    bl_idname = "r2sego.show_trial_poses"
    bl_label = "Show Poses"
    bl_options = {"REGISTER", "UNDO"}

    number: IntProperty(
        name="Trial", description="Which planned trial, from 1; 0 is the next one", min=0, options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        return needs_study(cls, context)

    def perform(self, context):
        study = facts.study_path(context.scene)
        trial = _chosen(study, facts.read(study), self.number)
        robot, _ = show_trial(context.scene, study, trial)
        name = trial_name(trial.index).capitalize()
        return f"{name}: {trial.label}, {trial.chair}{hint_if_hidden(context, robot)}"


def show_trial(scene: bpy.types.Scene, study: str, trial: PlannedTrial) -> list[bpy.types.Object]:
    """The poses of a planned trial on the floor."""
    robot, chair = trial.robot_pose.values, trial.chair_pose.values
    return show_poses(scene, Path(study), trial_name(trial.index), robot, chair, trial.chair)


def _chosen(study: str, read: facts.StudyFacts, number: int) -> PlannedTrial:
    """Trial ``number`` as people count; with 0 the one that a session is at, or else the next."""
    if read.plan is None:
        raise TrialError(read.problem.rstrip("."))
    if not number:
        live = live_of(study)
        number = live.index + 1 if live is not None else read.next.number if read.next is not None else 0
    if not 0 < number <= len(read.plan.trials):
        cure = f"Choose one from 1 to {len(read.plan.trials)}."
        raise TrialError(f"there is no trial {number}" if number else "no trial is left", where=study, cure=cure)
    return read.plan.trials[number - 1]
