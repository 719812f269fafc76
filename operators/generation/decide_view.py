"""Accept or reject a generated view by hand."""

import bpy
from bpy.props import EnumProperty

from .. import state
from ..base import EngineOperator, description_of_choice, needs_idle_engine
from .views import OfOneView

_DECISIONS = [
    ("ACCEPT", "Accept", "Train the asset on the view whatever its figures"),
    ("REJECT", "Reject", "Do not train the asset on the view"),
    ("UNDECIDED", "By Its Figures", "Let the figures of its registration decide again"),
]

_DECIDED = {"ACCEPT": "is accepted", "REJECT": "is rejected", "UNDECIDED": "is decided by its figures"}


class R2SEGO_OT_decide_view(OfOneView, EngineOperator, bpy.types.Operator):
    """Accept or reject a generated view by hand; the next Refine trains the asset again"""

    bl_idname = "r2sego.decide_view"
    bl_label = "Accept or Reject View"
    bl_options = {"REGISTER"}

    decision: EnumProperty(name="Decision", description="What is to become of the view", items=_DECISIONS)

    @classmethod
    def poll(cls, context):
        return super().poll(context) and needs_idle_engine(cls)

    @classmethod
    def description(cls, context, properties):
        return description_of_choice(properties, "decision")

    def arguments(self, context):
        bundle, shown, record = self.chosen(context)
        self.view = record.rank  # what is meant stays so until the engine has ended
        return [
            "views",
            str(bundle.path),
            "--round",
            str(shown),
            f"--{self.decision.lower()}",
            str(record.rank),
            "--json-progress",
        ]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"View {self.view} {_DECIDED[self.decision]}: run Refine to train on what is accepted"
