"""Pick what the robot sits on."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.robot.scope_picking import target_under
from ...r2sego_blender.bridge.shared.scope_rays import is_over, mouse_ray
from ...r2sego_blender.core.errors import RobotError
from ..view_tool import ViewTool
from .declaring import DeclaringOperator


class R2SEGO_OT_pick_target(ViewTool, DeclaringOperator, bpy.types.Operator):
    """Click the object the robot is to sit on: on the shown proxy, else the place; ESC cancels"""

    bl_idname = "r2sego.pick_target"
    bl_label = "Pick Target"
    bl_options = {"REGISTER"}

    target: StringProperty(
        name="Target", description="An object's name, a place x,y in metres, or any: every seat", options={"SKIP_SAVE"}
    )

    hint = "Click: the object, or the place, to sit on · ESC: cancel"
    cursor = "EYEDROPPER"

    def invoke(self, context, event):
        if self.target:
            return self.execute(context)
        return self.start_tool(context)

    def on_event(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            return {"CANCELLED"}
        clicked = event.type == "LEFTMOUSE" and event.value == "PRESS"
        if not clicked or not is_over(context.region, event):
            return {"PASS_THROUGH"}
        ray = mouse_ray(context.region, event)
        self.target = target_under(context.scene, context.evaluated_depsgraph_get(), *ray)
        return self.execute(context)

    def changes(self, context):
        if not self.target:
            raise RobotError("nothing is there to sit on", cure="Click on the proxy or on the collision.")
        return ["--target", self.target]
