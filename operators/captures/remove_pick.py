"""Take a picked point away."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.core.errors import CaptureError
from .. import state
from ..base import ReportingOperator


class R2SEGO_OT_remove_pick(ReportingOperator, bpy.types.Operator):
    """Take a picked point away, with the known lengths that end at it"""

    bl_idname = "r2sego.remove_pick"
    bl_label = "Remove Point"
    bl_options = {"REGISTER", "UNDO"}

    point: StringProperty(name="Point", description="Name of the point; empty = the chosen one", options={"SKIP_SAVE"})
    capture: StringProperty(
        name="Capture", description="Only its pick in this capture; empty = the whole point", options={"SKIP_SAVE"}
    )
    everything: BoolProperty(name="Everything", description="Every picked point and length", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        if not len(context.scene.r2sego_captures.points):
            cls.poll_message_set("No point is picked yet: there is none to remove")
            return False
        return True

    @classmethod
    def description(cls, context, properties):
        return "Take every picked point and length away" if properties.everything else cls.__doc__

    def perform(self, context):
        shown = context.scene.r2sego_captures
        if self.everything:
            shown.points.clear()
            shown.lengths.clear()
            state.catch_up(context.scene)
            return "Removed every pick"
        name = self.point
        if not name and 0 <= shown.active_point < len(shown.points):
            name = shown.points[shown.active_point].name
        index = shown.points.find(name)
        if index < 0:
            raise CaptureError(f"there is no picked point '{name}'", cure="Choose one of the list.")
        point = shown.points[index]
        if self.capture:
            place = next((i for i, view in enumerate(point.views) if view.capture == self.capture), None)
            if place is None:
                raise CaptureError(f"'{name}' is not picked in '{self.capture}'", cure="Choose another capture.")
            point.views.remove(place)
        if not self.capture or not len(point.views):
            shown.points.remove(index)
            for place in reversed(range(len(shown.lengths))):
                if name in (shown.lengths[place].start, shown.lengths[place].end):
                    shown.lengths.remove(place)
        shown.active_point = max(0, min(shown.active_point, len(shown.points) - 1))
        state.catch_up(context.scene)
        return f"Removed {name}"
