"""Pick the same point of the room in several photographs."""

import bpy
from bpy.props import BoolProperty, FloatProperty, StringProperty

from ...r2sego_blender.bridge.captures.show_captures import looked_through
from ...r2sego_blender.bridge.shared.cameras import camera_of, has_lens
from ...r2sego_blender.bridge.shared.scope_rays import is_over, mouse_ray
from ...r2sego_blender.bridge.shared.views_3d import looks_through_scene_camera
from ...r2sego_blender.core.errors import CaptureError, R2SEgoError
from ...r2sego_blender.core.formatting import counted
from ...r2sego_blender.results.panels.registration_pixels import next_name, pixel_of_ray
from .. import state
from ..base import ReportingOperator, needs_bundle
from ..view_tool import ViewTool
from .look_through_next import step_capture

_NAVIGATION = {"MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM", "MOUSEMOVE"}
_STEPS = {"PAGE_DOWN": 1, "RIGHT_ARROW": 1, "PAGE_UP": -1, "LEFT_ARROW": -1}
_ENDS = {"RET", "NUMPAD_ENTER", "ESC", "RIGHTMOUSE"}


class R2SEGO_OT_pick_point(ViewTool, ReportingOperator, bpy.types.Operator):
    """Pick the same point of the room in several photographs"""

    bl_idname = "r2sego.pick_point"
    bl_label = "Pick Point"
    bl_description = (
        "Click a point in a photograph, then the same point in others. "
        "Page Up and Page Down change the photograph, Enter ends"
    )
    bl_options = {"REGISTER", "UNDO"}

    point: StringProperty(name="Point", description="Name of the point; empty = a new point", options={"SKIP_SAVE"})
    capture: StringProperty(name="Capture", description="The capture it is picked in", options={"SKIP_SAVE"})
    x_px: FloatProperty(name="X", description="Pixels from the left of the capture's image", subtype="PIXEL", min=0.0)
    y_px: FloatProperty(name="Y", description="Pixels from the top of the capture's image", subtype="PIXEL", min=0.0)
    floor: BoolProperty(name="Floor", description="A new point lies on the floor")

    hint = "Click the point    Page Up, Page Down: other photograph    Enter, ESC: end"
    cursor = "CROSSHAIR"

    @classmethod
    def poll(cls, context):
        if not needs_bundle(cls, context):
            return False
        if not len(context.scene.r2sego_captures.captures):
            cls.poll_message_set("The scene has no captures to pick in: they are missing or damaged")
            return False
        return True

    def invoke(self, context, event):
        if self.capture:
            return self.execute(context)
        return self.start_tool(context)

    def on_start(self, context):
        if not self._looks_through_a_capture(context):
            step_capture(context, 0)
        self.changed = False

    def on_event(self, context, event):
        if event.value == "PRESS" and event.type in _ENDS:
            return {"FINISHED"} if self.changed else {"CANCELLED"}
        if event.value == "PRESS" and event.type in _STEPS:
            try:
                step_capture(context, _STEPS[event.type])
            except R2SEgoError as error:
                self.report({"WARNING"}, str(error))
            return {"RUNNING_MODAL"}
        inside = is_over(context.region, event)
        if event.type == "LEFTMOUSE" and inside:
            if event.value == "PRESS":
                self._click(context, event)
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"} if event.type in _NAVIGATION or not inside else {"RUNNING_MODAL"}

    def perform(self, context):
        shown = context.scene.r2sego_captures
        captures = {one.name: one for one in shown.captures}
        if self.capture not in captures:
            raise CaptureError(f"there is no capture '{self.capture}'", cure=f"Name one of {', '.join(captures)}.")
        width, height = captures[self.capture].width, captures[self.capture].height
        if not (self.x_px <= width and self.y_px <= height):
            raise CaptureError(
                f"pixel ({self.x_px:.0f}, {self.y_px:.0f}) lies outside the {width}x{height} image",
                where=self.capture,
                cure="Pick in the photograph.",
            )
        point = shown.points.get(self.point) if self.point else None
        if point is None:
            point = shown.points.add()
            point.name = self.point or next_name([one.name for one in shown.points[:-1]])
            point.floor = self.floor
            self.point = point.name
        view = next((one for one in point.views if one.capture == self.capture), None) or point.views.add()
        view.capture, view.x_px, view.y_px = self.capture, self.x_px, self.y_px
        shown.active_point = shown.points.find(point.name)
        state.catch_up(context.scene)
        placed = point.placed
        off = f", {placed.off_px:.2f} px off" if placed is not None and placed.off_px >= 0.0 else ""
        return f"Point {point.name} in {counted(len(point.views), 'capture')}{off}"

    def _looks_through_a_capture(self, context):
        return (
            looks_through_scene_camera(context)
            and has_lens(context.scene.camera)
            and _looked_through(context) in context.scene.r2sego_captures.captures
        )

    def _click(self, context, event):
        if not self._looks_through_a_capture(context):
            self.report({"WARNING"}, "Look through a capture to pick in it")
            return
        camera = camera_of(context.scene.camera)
        _, ray = mouse_ray(context.region, event)
        pixel = pixel_of_ray(camera, ray)
        if pixel is None:
            self.report({"WARNING"}, "That is outside the photograph")
            return
        self.capture = _looked_through(context)
        self.x_px, self.y_px = pixel
        self.changed |= self.execute(context) == {"FINISHED"}


def _looked_through(context):
    return looked_through(context.scene, state.bundle_path(context.scene))
