"""The sub-panel Engine: its set-up, the running job, and the lines of jobs that ended."""

import bpy

from ..r2sego_blender.bridge.shared.engine_python import addon_preferences
from ..r2sego_blender.results.doctor import REQUIRED_MB
from ..r2sego_blender.workers.environment import DOWNLOAD_MB
from .sidebar import Step, fitting_characters, wrapped

_ICONS = {"INFO": "CHECKMARK", "WARNING": "CANCEL", "ERROR": "ERROR"}
_PICTURE_SCALE = 8.0


def told_of_engine(engine) -> tuple[str, str]:
    """What is known of the engine while it is idle, and its icon."""
    if not engine.found:
        return "Idle, not checked yet", "NONE"
    return ("Packages are missing", "ERROR") if "missing: " in engine.found else ("Ready", "CHECKMARK")


class R2SEGO_PT_engine(Step, bpy.types.Panel):
    """The process that does the numeric work, and what it is doing"""

    bl_idname = "R2SEGO_PT_engine"
    bl_label = "Engine"
    bl_order = 0

    def draw(self, context):
        manager = context.window_manager
        if manager.r2sego_job.running:
            self._draw_job(context, manager.r2sego_job, manager.r2sego_engine)
        elif not manager.r2sego_engine.has_python:
            self._draw_set_up(context)
        else:
            self._draw_idle(context)
        for index, end in enumerate(manager.r2sego_engine.ended):
            self._draw_end(context, index, end)

    def _draw_job(self, context, job, engine):
        column = self.layout.column(align=True)
        row = column.row()
        row.label(text=job.title)
        since = row.row()
        since.alignment, since.active = "RIGHT", False
        since.label(text=f"for {engine.running_for}")
        if job.of_bundle:
            column.label(text=f"of {job.of_bundle}", icon="FILE_FOLDER")
        column.progress(factor=job.fraction, text=f"{job.task} {job.fraction:.0%}")
        if engine.time_left and job.fraction < 1.0:
            column.label(text=f"{engine.time_left} in this step", icon="TIME")
        for line in wrapped(job.message, fitting_characters(context, 1.0)):
            column.label(text=line)
        if engine.picture_icon:
            column.template_icon(icon_value=engine.picture_icon, scale=_PICTURE_SCALE)
        row = self.layout.row()
        row.enabled = not job.cancel_requested
        row.operator("r2sego.cancel", text="Cancelling" if job.cancel_requested else "Cancel", icon="X")

    def _draw_set_up(self, context):
        column = self.layout.column(align=True)
        column.label(text=f"{DOWNLOAD_MB} MB to download,")
        column.label(text=f"{REQUIRED_MB / 1000:.1f} GB on the disk")
        row = self.layout.row()
        row.scale_y = 1.2
        row.operator("r2sego.set_up_engine", icon="IMPORT")
        column = self.layout.column(align=True)
        column.label(text="Or a Python that has the packages:")
        preferences = addon_preferences()
        if preferences is not None:
            column.prop(preferences, "engine_python", text="")

    def _draw_idle(self, context):
        row = self.layout.row(align=True)
        if not context.scene.r2sego.bundle:
            row.operator("r2sego.demo_scene", icon="HOME")
        else:
            text, icon = told_of_engine(context.window_manager.r2sego_engine)
            row.label(text=text, icon=icon)
        row.operator("r2sego.check_engine", text="", icon="QUESTION")

    def _draw_end(self, context, index, end):
        box = self.layout.box()
        box.alert = end.level == "ERROR"
        row = box.row()
        row.label(text=end.title, icon=_ICONS[end.level])
        row.operator("r2sego.dismiss_job", text="", icon="X", emboss=False).index = index
        column = box.column(align=True)
        for line in wrapped(end.line, fitting_characters(context, 0.85)):
            column.label(text=line)


CLASSES = (R2SEGO_PT_engine,)
