"""Choose the robot."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.core.errors import R2SEgoError, RobotError
from .. import state
from ..base import told
from .declaring import DeclaringOperator

_EMBEDDED = {"HUMANOID": "embedded:humanoid", "WHEELED": "embedded:wheeled"}


class R2SEGO_OT_choose_robot(DeclaringOperator, bpy.types.Operator):
    """Declare the robot whose rollouts count; the next Refine redoes what depends on it"""

    bl_idname = "r2sego.choose_robot"
    bl_label = "Choose Robot"
    bl_options = {"REGISTER"}

    robot: EnumProperty(
        name="Robot",
        description="The robot",
        items=[
            ("HUMANOID", "Humanoid", "The embedded humanoid, in the published size of the Unitree G1"),
            ("WHEELED", "Wheeled", "The embedded wheeled base with a camera on a mast"),
            ("FILE", "File", "An MJCF or URDF file"),
        ],
    )
    filepath: StringProperty(
        name="File", description="An MJCF or URDF file with one free base, legs or wheels", subtype="FILE_PATH"
    )

    def invoke(self, context, event):
        try:
            declared = state.opened_bundle(context).scene.declaration.robot
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        self.robot = next((key for key, name in _EMBEDDED.items() if name == declared), "FILE")
        self.filepath = declared if self.robot == "FILE" else ""
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.prop(self, "robot")
        if self.robot == "FILE":
            self.layout.prop(self, "filepath")

    def changes(self, context):
        if self.robot == "FILE" and not self.filepath:
            raise RobotError("no robot file is chosen", cure="Choose an MJCF or a URDF.")
        return ["--robot", _EMBEDDED.get(self.robot) or bpy.path.abspath(self.filepath)]
