"""Set how far the resting robot keeps from obstacles."""

import bpy

from ...r2sego_blender.bridge.shared.declared_properties import declared_property
from ...r2sego_blender.config.fields import fields_of
from ...r2sego_blender.core.errors import R2SEgoError
from ...r2sego_blender.results.panels.robot_facts import RobotFacts
from ...r2sego_blender.robot.scope.scope import Region
from .. import state
from ..base import told
from .declaring import DeclaringOperator


class R2SEGO_OT_set_clearance(DeclaringOperator, bpy.types.Operator):
    """Set how far the resting robot's reach keeps from obstacles; where floor is scarce, less"""

    bl_idname = "r2sego.set_clearance"
    bl_label = "Set Clearance"
    bl_options = {"REGISTER"}

    clearance: declared_property(fields_of(Region)["clearance_m"], name="Clearance", subtype="DISTANCE", unit="LENGTH")

    def invoke(self, context, event):
        try:
            self.clearance = RobotFacts.read(state.opened_bundle(context)).scope.region.clearance_m
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        return context.window_manager.invoke_props_dialog(self)

    def changes(self, context):
        return ["--set", f"region.clearance_m={self.clearance:.6g}"]
