"""Cut the proxy's faces away, add drawn surfaces, and take either back."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.proxy.proxy_edits import write_cut, write_drawn
from ...r2sego_blender.bridge.proxy.show_proxy import shown_proxies
from ...r2sego_blender.core.errors import GeometryError
from .. import state
from ..base import EngineOperator, needs_bundle, needs_idle_engine
from ..engine_files import handed_over
from .polls import needs_proxy, proxy_shown

_NEXT = "the next Refine redoes the proxy"


class _Edit(EngineOperator):
    """An operator that changes the edits by ``r2sego edit-proxy``."""

    def arguments(self, context):
        return ["edit-proxy", str(state.opened_bundle(context).path), *self.change(context), "--json-progress"]

    def change(self, context) -> list[str]:
        """The options that say what is changed."""
        raise NotImplementedError


class R2SEGO_OT_cut_proxy(_Edit, bpy.types.Operator):
    """Cut the selected faces of the shown proxy away, in this and all later refinements"""

    bl_idname = "r2sego.cut_proxy"
    bl_label = "Cut Selected Faces"
    bl_options = {"REGISTER"}

    name: StringProperty(name="Name", description="What the edit is called", default="cut")

    @classmethod
    def poll(cls, context):
        return needs_proxy(cls, context) and needs_idle_engine(cls)

    def change(self, context):
        file = handed_over("cut.npz")
        write_cut(file, proxy_shown(context))
        return ["--cut", str(file), "--name", self.name or "cut"]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"Cut kept: {_NEXT}"


class R2SEGO_OT_draw_proxy_surface(_Edit, bpy.types.Operator):
    """Add the active mesh object to the proxy, in this and all later refinements, as a prior"""

    bl_idname = "r2sego.draw_proxy_surface"
    bl_label = "Add Active Mesh"
    bl_options = {"REGISTER"}

    object_name: StringProperty(
        name="Object", description="The mesh object; empty = the active one", options={"SKIP_SAVE"}
    )
    name: StringProperty(
        name="Name", description="What the edit is called; empty = as the object", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        return needs_bundle(cls, context) and needs_idle_engine(cls)

    def change(self, context):
        drawn = bpy.data.objects.get(self.object_name) if self.object_name else context.view_layer.objects.active
        if drawn is None or drawn.type != "MESH":
            raise GeometryError("no mesh object is chosen", cure="Select the surface you drew.")
        if drawn in shown_proxies():  # which is the active one after a lasso
            raise GeometryError("this is the shown proxy itself", where=drawn.name, cure="Select the surface you drew.")
        file = handed_over("surface.npz")
        write_drawn(file, drawn, context.evaluated_depsgraph_get())
        return ["--draw", str(file), "--name", self.name or drawn.name]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"Surface kept: {_NEXT}"


class R2SEGO_OT_remove_proxy_edit(_Edit, bpy.types.Operator):
    """Take an edit of the proxy back"""

    bl_idname = "r2sego.remove_proxy_edit"
    bl_label = "Remove Edit"
    bl_options = {"REGISTER"}

    name: StringProperty(name="Name", description="The edit; empty = the one chosen in the list", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego_proxy.edits:
            cls.poll_message_set("The proxy has no edits: nothing was cut away or added yet")
            return False
        return True

    def change(self, context):
        group = context.scene.r2sego_proxy
        return ["--remove", self.name or group.edits[min(group.edit_index, len(group.edits) - 1)].name]

    def finish(self, context, result):
        state.refresh(context.scene)
        return f"Edit taken back: {_NEXT}"
