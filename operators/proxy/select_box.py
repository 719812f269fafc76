"""Select the proxy's faces inside a box."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bridge.asset.placed_box import placed_box
from ...r2sego_blender.bridge.proxy.proxy_edits import select_faces, world_corners
from ...r2sego_blender.core.errors import GeometryError
from ...r2sego_blender.core.formatting import counted
from ..base import ReportingOperator
from .polls import in_object_mode, needs_proxy, proxy_shown, show_selection


class R2SEGO_OT_select_proxy_box(ReportingOperator, bpy.types.Operator):
    """Select the faces of the shown proxy inside the active object's bounding box"""

    bl_idname = "r2sego.select_proxy_box"
    bl_label = "Select in Box"
    bl_options = {"REGISTER", "UNDO"}

    box: StringProperty(
        name="Box", description="The object whose box counts; empty = the active one", options={"SKIP_SAVE"}
    )
    extend: BoolProperty(name="Extend", description="Keep what is selected already")

    @classmethod
    def poll(cls, context):
        return needs_proxy(cls, context)

    def perform(self, context):
        shown = proxy_shown(context)
        box = bpy.data.objects.get(self.box) if self.box else context.view_layer.objects.active
        if box is None or box == shown:
            raise GeometryError("no box is chosen", cure="Select a mesh or a cube empty around the faces.")
        in_object_mode(context, shown)
        context.view_layer.update()
        faces = placed_box(box).holds(world_corners(shown).mean(axis=1))
        count = select_faces(shown, faces, extend=self.extend)
        show_selection(context, shown)
        return f"{counted(count, 'face')} selected"
