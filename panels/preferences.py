"""The add-on's preferences: which Python runs the engine, and how much is drawn."""

import bpy
from bpy.props import IntProperty, StringProperty

from ..r2sego_blender.bridge.scene.faces_drawn import draw_fewer_faces_of_all

ROOT = __package__.rpartition(".")[0]


def _draw_so_many(preferences, context):
    draw_fewer_faces_of_all(preferences.drawn_faces)


def _is_another(preferences, context):
    context.window_manager.r2sego_engine.found = ""  # which was another Python's


class R2SEGO_AP_preferences(bpy.types.AddonPreferences):
    """Which Python runs the engine, and how much is drawn"""

    bl_idname = ROOT

    engine_python: StringProperty(
        name="Engine Python",
        subtype="FILE_PATH",
        update=_is_another,
        description="The python of the environment that has the engine's packages; empty = the variable R2SEGO_PYTHON",
    )
    drawn_faces: IntProperty(
        name="Faces Drawn",
        default=0,
        min=0,
        soft_max=200_000,
        step=1000,
        update=_draw_so_many,
        description="The most faces of a geometry proxy that 3D views draw outside Edit Mode, and twice as "
        "many as of a robot and of the candidates' frusta; 0 = all",
    )

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "engine_python")
        row = layout.row()
        row.operator("r2sego.set_up_engine", icon="IMPORT")
        row.operator("r2sego.check_engine", icon="CHECKMARK")
        layout.label(text=context.window_manager.r2sego_engine.found or "Not checked yet")
        row = layout.row()
        row.operator("r2sego.check_backends", icon="CHECKMARK")
        row.label(text="Learned models, each in a Python of its own: r2sego backend install NAME")
        for one in context.window_manager.r2sego_engine.backends:
            row = layout.row()
            row.label(text=f"{one.name} ({one.licence})", icon="CHECKMARK" if not one.why else "X")
            row.label(text=one.why or "Can be used")
        layout.separator()
        layout.prop(self, "drawn_faces")
        row = layout.row()
        row.operator("r2sego.simplify_viewport", icon="SHADING_WIRE")
        row.label(text="For a Blender without a graphics card")


CLASSES = (R2SEGO_AP_preferences,)
