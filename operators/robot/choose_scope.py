"""Choose the behaviour scope."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.core.errors import R2SEgoError, RobotError
from ...r2sego_blender.robot.scope.scope import shipped_scopes
from .. import state
from ..base import told
from .declaring import DeclaringOperator

_DOCS = {
    "walk_and_look": "Walk to free places of the room and look around",
    "sit_down": "Walk to a seat, turn, sit down on it and look around",
}


def _title(name):
    """A scope's name as Blender writes names: walk_and_look is Walk and Look."""
    return name.replace("_", " ").title().replace(" And ", " and ")


class R2SEGO_OT_choose_scope(DeclaringOperator, bpy.types.Operator):
    """Declare the behaviour scope: which motions, places and views the refinement is for"""

    bl_idname = "r2sego.choose_scope"
    bl_label = "Choose Scope"
    bl_options = {"REGISTER"}

    scope: EnumProperty(
        name="Scope",
        description="The behaviour scope",
        items=[
            *((name, _title(name), _DOCS.get(name, name)) for name in shipped_scopes()),
            ("FILE", "File", "A TOML file, as docs/behaviour-scope.md describes"),
        ],
    )
    filepath: StringProperty(name="File", description="The behaviour scope's TOML file", subtype="FILE_PATH")

    def invoke(self, context, event):
        try:
            declared = state.opened_bundle(context).scene.declaration.scope
        except (R2SEgoError, OSError) as error:
            self.report({"ERROR"}, told(error))
            return {"CANCELLED"}
        self.scope = declared if declared in shipped_scopes() else "FILE"
        self.filepath = declared if self.scope == "FILE" else ""
        return context.window_manager.invoke_props_dialog(self, width=400)

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.prop(self, "scope")
        if self.scope == "FILE":
            self.layout.prop(self, "filepath")

    def changes(self, context):
        if self.scope != "FILE":
            return ["--scope", self.scope]
        if not self.filepath:
            raise RobotError("no scope file is chosen", cure="Choose a TOML file.")
        return ["--scope", bpy.path.abspath(self.filepath)]
