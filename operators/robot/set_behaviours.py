"""Set how often each behaviour is drawn."""

import bpy

from ...r2sego_blender.bridge.shared.declared_properties import declared_property
from ...r2sego_blender.config.fields import fields_of
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from ...r2sego_blender.robot.behaviours.registry import BEHAVIOURS
from ...r2sego_blender.robot.scope.scope import Behaviours
from .. import state
from ..base import told
from .declaring import DeclaringOperator


def _weight(behaviour):
    field = fields_of(Behaviours)[behaviour.name]
    legs = "; takes legs" if behaviour.needs_legs else ""
    return declared_property(
        field, behaviour.name.replace("_", " ").title(), description=field.doc.rstrip(".") + legs, soft_max=1
    )


class R2SEGO_OT_set_behaviours(DeclaringOperator, bpy.types.Operator):
    """Set how often each behaviour is drawn, relative to the others"""

    bl_idname = "r2sego.set_behaviours"
    bl_label = "Set Behaviours"
    bl_options = {"REGISTER"}

    __annotations__ = {behaviour.name: _weight(behaviour) for behaviour in BEHAVIOURS}

    def invoke(self, context, event):
        try:
            declared = RobotFacts.read(state.opened_bundle(context)).scope.behaviours
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        for behaviour in BEHAVIOURS:
            setattr(self, behaviour.name, getattr(declared, behaviour.name))
        return context.window_manager.invoke_props_dialog(self)

    def changes(self, context):
        told = [f"behaviours.{one.name}={getattr(self, one.name):.6g}" for one in BEHAVIOURS]
        return [part for field in told for part in ("--set", field)]
