"""Tell the running session what the operator does."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.core.errors import TrialError
from ...r2sego_blender.trials.outcome import Outcome
from ...r2sego_blender.trials.running.controls import Control, send
from ..base import ReportingOperator, description_of_choice
from . import facts
from .polls import needs_study
from .session import require_session

_CONTROLS = [
    ("ARM", "Arm", "Robot and chair stand as planned: record from now on"),
    ("START", "Start", "The policy starts now"),
    ("END", "End", "The attempt is over: judge it"),
    ("INTERVENE", "Intervention", "The operator helped the robot: a failure"),
    ("ABORT", "Abort", "Something else went wrong: the trial is unusable, for the reason given"),
    ("NOTE", "Note", "A note for the record"),
    ("VIDEO", "Video Mark", "A camera shows this moment, as by a clap or a lamp; the text says which camera"),
    ("NEXT", "Next", "On to the next trial, or to another self-test"),
    ("STOP", "Stop", "No more trials now; one that runs becomes unusable"),
]
_WITH_TEXT = {"ABORT", "NOTE", "VIDEO"}


def _tell(context, control, **data):
    study = facts.study_path(context.scene)
    require_session(study)
    send(Path(study), control, **data)


class R2SEGO_OT_tell_session(ReportingOperator, bpy.types.Operator):
    """Tell the session that runs what you do; it is recorded with the trial"""

    bl_idname = "r2sego.tell_session"
    bl_label = "Tell Session"
    bl_options = {"REGISTER"}

    control: EnumProperty(name="Control", description="What you do", items=_CONTROLS)
    text: StringProperty(name="Text", description="A note, a reason, or which camera", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return needs_study(cls, context)

    @classmethod
    def description(cls, context, properties):
        return description_of_choice(properties, "control")

    def invoke(self, context, event):
        if self.control in _WITH_TEXT and not self.text:
            return context.window_manager.invoke_props_dialog(self, width=400)
        return self.execute(context)

    def draw(self, context):
        self.layout.prop(self, "text")

    def perform(self, context):
        _tell(context, Control[self.control], **({"text": self.text} if self.text else {}))


class R2SEGO_OT_judge_trial(ReportingOperator, bpy.types.Operator):
    """Judge the last trial by hand, in place of the sensors; the record says who did, and why"""

    bl_idname = "r2sego.judge_trial"
    bl_label = "Judge by Hand"
    bl_options = {"REGISTER"}

    outcome: EnumProperty(
        name="Outcome",
        description="What the trial ended in",
        items=[
            ("SUCCESS", "Success", "The robot sat, without help, for the time that the rules say"),
            ("FAILURE", "Failure", "It did not"),
            ("UNUSABLE", "Unusable", "The recording tells nothing of the robot: the trial is run again"),
        ],
    )
    by: StringProperty(name="Judged By", description="Who judges")
    text: StringProperty(name="Why", description="What the judgement rests on", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return needs_study(cls, context)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ("outcome", "by", "text"):
            self.layout.prop(self, name)

    def perform(self, context):
        if not (self.by.strip() and self.text.strip()):
            raise TrialError("a judgement by hand names who judges, and why", cure="Give both.")
        told = {"outcome": Outcome[self.outcome].value, "by": self.by.strip(), "text": self.text.strip()}
        _tell(context, Control.JUDGE, **told)
        return f"Judged by {self.by.strip()}: {self.outcome.lower()}"
