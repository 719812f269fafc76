"""Compare two pictures in the camera's frame: the photograph as one of them, and the divider."""

import bpy
from bpy.props import EnumProperty, FloatProperty

from ...r2sego_blender.bridge.asset.asset_frame import camera_frame_px
from ...r2sego_blender.bridge.asset.asset_pictures import note_pose, photograph_of, pose_values
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.core.errors import SceneError
from ..base import ReportingOperator
from ..view_tool import ViewTool


class R2SEGO_OT_compare_photograph(ReportingOperator, bpy.types.Operator):
    """Put the photograph of the scene's camera on one side of the wipe"""

    bl_idname = "r2sego.compare_photograph"
    bl_label = "Compare Photograph"
    bl_options = {"REGISTER", "UNDO"}

    side: EnumProperty(
        name="Side",
        description="Where the photograph is shown",
        items=[("LEFT", "Left", "On the left of the divider"), ("RIGHT", "Right", "On the right of it")],
    )

    @classmethod
    def poll(cls, context):
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera: press Import under Captures")
            return False
        return True

    def perform(self, context):
        photograph = photograph_of(context.scene.camera)
        if photograph is None:
            raise SceneError(
                "this camera has no photograph",
                where=context.scene.camera.name,
                cure="Look through a camera that Import Captures made.",
            )
        note_pose(photograph, pose_values(context.scene.camera))
        group = context.scene.r2sego_asset
        if self.side == "LEFT":
            group.wipe_left = photograph
        else:
            group.wipe_right = photograph
        group.compare = True
        return ""


class R2SEGO_OT_move_wipe(ViewTool, ReportingOperator, bpy.types.Operator):
    """Move the divider between the two pictures with the mouse"""

    bl_idname = "r2sego.move_wipe"
    bl_label = "Move Wipe"
    bl_options = {"REGISTER", "UNDO"}

    factor: FloatProperty(
        name="Wipe",
        description="Where the left picture ends, as a share of the width",
        subtype="FACTOR",
        min=0.0,
        max=1.0,
        default=0.5,
    )

    hint = "Wipe: move the mouse, click to keep (ESC cancels)"

    @classmethod
    def poll(cls, context):
        if not context.scene.r2sego_asset.compare:
            cls.poll_message_set("Compare two pictures first: put a photograph or a rendering on a side")
            return False
        return True

    def perform(self, context):
        context.scene.r2sego_asset.wipe = self.factor
        redraw_views("WINDOW")
        return ""

    def invoke(self, context, event):
        if context.area is None or context.area.type != "VIEW_3D":
            return self.execute(context)
        return self.start_tool(context)

    def on_start(self, context):
        self._before = self.factor = context.scene.r2sego_asset.wipe

    def on_event(self, context, event):
        frame = camera_frame_px(context)
        if event.type == "MOUSEMOVE" and frame is not None:
            left, _, width, _ = frame
            self.factor = min(1.0, max(0.0, (event.mouse_x - context.region.x - left) / width))
            context.scene.r2sego_asset.wipe, self.changed = self.factor, True
        elif event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self.execute(context)
        elif event.type in {"ESC", "RIGHTMOUSE"}:
            context.scene.r2sego_asset.wipe = self._before
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}
