"""Draw the 3D views faster where there is no graphics card."""

import bpy

from ...r2sego_blender.bridge.scene.faces_drawn import draw_fewer_faces_of_all
from ...r2sego_blender.bridge.shared.engine_python import addon_preferences
from ...r2sego_blender.bridge.shared.simplified_viewport import FACES_DRAWN, simplify_views
from ..base import ReportingOperator


class R2SEGO_OT_simplify_viewport(ReportingOperator, bpy.types.Operator):
    """Without a graphics card: no smooth edges, outlines or grids, fewer faces and fewer candidates"""

    bl_idname = "r2sego.simplify_viewport"
    bl_label = "Simplify Viewport"
    bl_options = {"REGISTER", "UNDO"}

    def perform(self, context):
        simplify_views()
        preferences = addon_preferences()
        if preferences is not None:
            preferences.drawn_faces = FACES_DRAWN  # which has all that is shown drawn so
        else:  # a script on a checkout
            draw_fewer_faces_of_all(FACES_DRAWN)
        return (
            "Smooth edges, outlines and grids are off, views end at their side bars, "
            f"a proxy is drawn with {FACES_DRAWN} faces at most"
        )
