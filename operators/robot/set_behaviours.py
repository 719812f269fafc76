"""Set how often each behaviour is drawn."""

import bpy
from bpy.props import FloatProperty

from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from .. import state
from ..base import told
from .declaring import DeclaringOperator

_NAMES = ("walk_to", "look_around", "step_around", "squat", "sit_on")


def _weight(name, description, default=0.0):
    return FloatProperty(name=name, description=description, default=default, min=0.0, max=1000.0, soft_max=1)


class R2SEGO_OT_set_behaviours(DeclaringOperator, bpy.types.Operator):
    """Set how often each behaviour is drawn, relative to the others"""

    bl_idname = "r2sego.set_behaviours"
    bl_label = "Set Behaviours"
    bl_options = {"REGISTER"}

    walk_to: _weight("Walk To", "Walk to a place, looking around", 0.7)
    look_around: _weight("Look Around", "Stand, turn and look around", 0.3)
    step_around: _weight("Step Around", "Step aside, forward and back, facing one way")
    squat: _weight("Squat", "Stand, lower the body and look down, as for reaching; takes legs")
    sit_on: _weight("Sit On", "Walk to a seat, turn, sit down and look around; takes legs")

    def invoke(self, context, event):
        try:
            declared = RobotFacts.read(state.opened_bundle(context)).scope.behaviours
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        for name in _NAMES:
            setattr(self, name, getattr(declared, name))
        return context.window_manager.invoke_props_dialog(self)

    def changes(self, context):
        told = [f"behaviours.{name}={getattr(self, name):.6g}" for name in _NAMES]
        return [part for field in told for part in ("--set", field)]
