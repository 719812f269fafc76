"""Run a session of trials."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import TrialError
from ..base import EngineOperator, needs_idle_engine
from . import facts
from .polls import needs_study


class R2SEGO_OT_run_trials(EngineOperator, bpy.types.Operator):
    """Run the next trials with the device that judges them"""

    bl_idname = "r2sego.run_trials"
    bl_label = "Run Trials"
    bl_description = (
        "Run the next trials with the device that judges them; the panel tells what to do. "
        "The emergency stop is a circuit, not this program"
    )
    bl_options = {"REGISTER"}

    study: StringProperty(
        name="Study", description="The study's folder; empty = the open one", subtype="DIR_PATH", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        if not needs_study(cls, context):
            return False
        read, group = facts.of(context.scene), context.scene.r2sego_trials
        if read.state.ended or read.next is None:
            cls.poll_message_set("No trial is left: the study was ended, or all its trials were run")
            return False
        if not (group.simulated or group.device):
            cls.poll_message_set("Say first where the device is, or tick Simulated")
            return False
        return needs_idle_engine(cls)

    def arguments(self, context):
        group = context.scene.r2sego_trials
        self.study = facts.study_path(context.scene)
        command = ["trials", "run", self.study, "--json-progress"]
        if group.simulated:
            return [*command, "--simulated"]
        if not group.calibration:
            raise TrialError("no calibration is chosen", cure="Choose the file that r2sego trials calibrate wrote.")
        command += ["--device", group.device, "--calibration", bpy.path.abspath(group.calibration)]
        command += ["--adapter", group.adapter]
        return [*command, "--baud", str(group.baud)] if group.baud else command

    def finish(self, context, result):
        facts.read(self.study)
        return "The session has ended"
