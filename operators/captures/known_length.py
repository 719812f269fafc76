"""Known lengths between picked points."""

import bpy
from bpy.props import FloatProperty, IntProperty, StringProperty

from ...r2sego_blender.core.errors import CaptureError
from .. import state
from ..base import ReportingOperator


class R2SEGO_OT_add_length(ReportingOperator, bpy.types.Operator):
    """Say how far apart two picked points are"""

    bl_idname = "r2sego.add_length"
    bl_label = "Add Length"
    bl_options = {"REGISTER", "UNDO"}

    start: StringProperty(name="From", description="The one point", options={"SKIP_SAVE"})
    end: StringProperty(name="To", description="The other point", options={"SKIP_SAVE"})
    metres: FloatProperty(
        name="Length",
        description="How far apart they are",
        default=1.0,
        min=0.01,
        max=100.0,
        subtype="DISTANCE",
        unit="LENGTH",
        precision=3,
    )

    @classmethod
    def poll(cls, context):
        if len(context.scene.r2sego_captures.points) < 2:
            cls.poll_message_set("Pick two points in the photographs first")
            return False
        return True

    def invoke(self, context, event):
        points = context.scene.r2sego_captures.points
        if not (self.start and self.end):
            self.start, self.end = points[-2].name, points[-1].name
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        shown = context.scene.r2sego_captures
        self.layout.use_property_split = True
        self.layout.prop_search(self, "start", shown, "points")
        self.layout.prop_search(self, "end", shown, "points")
        self.layout.prop(self, "metres")

    def perform(self, context):
        shown = context.scene.r2sego_captures
        names = [point.name for point in shown.points]
        if self.start not in names or self.end not in names or self.start == self.end:
            raise CaptureError(
                f"a length from '{self.start}' to '{self.end}' is none: it needs two picked points",
                cure=f"Name two of {', '.join(names)}.",
            )
        ends = {self.start, self.end}
        length = next((one for one in shown.lengths if {one.start, one.end} == ends), None)
        if length is None:
            length = shown.lengths.add()
            length.start, length.end = self.start, self.end
        length.metres = self.metres
        state.catch_up(context.scene)
        return f"{self.start} to {self.end}: {self.metres:.3f} m"


class R2SEGO_OT_remove_length(ReportingOperator, bpy.types.Operator):
    """Take a known length away"""

    bl_idname = "r2sego.remove_length"
    bl_label = "Remove Length"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(name="Index", description="Its place in the list, from 0", min=0)

    @classmethod
    def poll(cls, context):
        if not len(context.scene.r2sego_captures.lengths):
            cls.poll_message_set("There is no length to remove: none was added")
            return False
        return True

    def perform(self, context):
        lengths = context.scene.r2sego_captures.lengths
        if self.index >= len(lengths):
            raise CaptureError(f"there is no length {self.index}", cure="Choose one of the list.")
        lengths.remove(self.index)
        state.catch_up(context.scene)
        return ""
