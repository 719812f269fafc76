"""Pick what the robot sits on."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.scope_picking import target_under
from ...r2sego_blender.bridge.scope_rays import is_over, mouse_ray, view_region
from ...r2sego_blender.errors import RobotError
from .declaring import DeclaringOperator

_HELP = "Click: the object, or the place, to sit on · ESC: cancel"


class R2SEGO_OT_pick_target(DeclaringOperator, bpy.types.Operator):
    """Click the object the robot is to sit on: on the shown proxy, else the place; ESC cancels"""

    bl_idname = "r2sego.pick_target"
    bl_label = "Pick Target"
    bl_options = {"REGISTER"}

    target: StringProperty(
        name="Target", description="An object's name, a place x,y in metres, or any: every seat"
    )

    def invoke(self, context, event):
        if self.target:
            return self.execute(context)
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, "The target is picked in a 3D view")
            return {"CANCELLED"}
        self._area = context.area
        context.workspace.status_text_set(_HELP)
        context.window.cursor_modal_set("EYEDROPPER")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            return self._leave(context, {"CANCELLED"})
        clicked = event.type == "LEFTMOUSE" and event.value == "PRESS"
        if not clicked or not is_over(view_region(self._area), event):
            return {"PASS_THROUGH"}
        ray = mouse_ray(self._area, event)
        self.target = target_under(context.scene, context.evaluated_depsgraph_get(), *ray)
        self._leave(context, set())
        return self.execute(context)

    def cancel(self, context):
        """Blender ends the operator, for example because another file is opened."""
        self._leave(context, {"CANCELLED"})

    def changes(self, context):
        if not self.target:
            raise RobotError("nothing is there to sit on", cure="Click on the proxy or on the collision.")
        return ["--target", self.target]

    def _leave(self, context, ended):
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return ended
