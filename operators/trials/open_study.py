"""Open a study of trials."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.core.errors import TrialError
from ...r2sego_blender.trials.plan.trial_plan import PLAN
from ..base import ReportingOperator, needs_own_scene
from . import facts
from .show_trial_poses import show_trial


class R2SEGO_OT_open_study(ReportingOperator, bpy.types.Operator):
    """Open a study of trials on a real robot, and show where robot and chair stand for its next trial"""

    bl_idname = "r2sego.open_study"
    bl_label = "Open Study"
    bl_options = {"REGISTER", "UNDO"}

    directory: StringProperty(
        name="Study", description="The study's folder, NAME.trials", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )
    show: BoolProperty(name="Show", description="Show the poses of the next trial on the floor", default=True)
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return needs_own_scene(cls, context)

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def perform(self, context):
        if not self.directory:
            raise TrialError("no study is chosen", cure="Choose a folder NAME.trials, or plan one with New Plan.")
        return open_study(context.scene, Path(bpy.path.abspath(self.directory)), show=self.show)


def open_study(scene: bpy.types.Scene, chosen: Path, *, show: bool = True) -> str:
    """Make the study in a folder the one that a Blender scene shows; returns a line for the person.

    Raises TrialError where there is none, or its plan was changed.
    """
    folder = str(chosen.parent if chosen.name == PLAN else chosen)
    study = str(Path(folder).absolute())
    read = facts.read(study)
    if read.plan is None:
        raise TrialError(read.problem.rstrip("."))
    scene.r2sego_trials.study = study
    if show and read.next is not None:
        show_trial(scene, study, read.next)
    return f"Opened {read.plan.name}: {len(read.plan.trials)} trials planned"
