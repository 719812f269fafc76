"""Show a round's geometry proxy."""

import bpy
from bpy.props import BoolProperty

from ...r2sego_blender.bridge.proxy.show_proxy import show_proxy
from .. import state
from ..base import ReportingOperator, hint_if_hidden, needs_round
from .facts import ProxyFacts
from .properties import colour_shown


class R2SEGO_OT_show_proxy(ReportingOperator, bpy.types.Operator):
    """Show the geometry proxy, coloured as chosen: by provenance, support, confidence or coverage"""

    bl_idname = "r2sego.show_proxy"
    bl_label = "Show Geometry Proxy"
    bl_options = {"REGISTER", "UNDO"}

    look_inside: BoolProperty(
        name="Look Inside",
        default=True,
        description="Hide faces seen from behind in this 3D view, so that the room's walls do not hide it",
    )

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context)

    def perform(self, context):
        index = context.scene.r2sego.round_index
        bundle = state.opened_bundle(context)
        shown = show_proxy(context.scene, bundle, index)
        state.read_again(context.scene, ProxyFacts)
        colour_shown(context.scene)
        if self.look_inside and context.area is not None and context.area.type == "VIEW_3D":
            context.space_data.shading.show_backface_culling = True
        return f"Proxy, round {index}: {len(shown.data.polygons)} faces{hint_if_hidden(context, shown)}"
