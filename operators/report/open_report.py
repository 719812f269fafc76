"""Open the report in the web browser."""

import bpy

from ...r2sego_blender.core.errors import SceneError
from .. import state
from ..base import ReportingOperator, needs_bundle
from ..web_page import open_page


class R2SEGO_OT_open_report(ReportingOperator, bpy.types.Operator):
    """Open the report, a page on this machine, in the web browser"""

    bl_idname = "r2sego.open_report"
    bl_label = "Open Report"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not needs_bundle(cls, context):
            return False
        if not context.scene.r2sego.has_report:
            cls.poll_message_set("There is no report yet: run Refine first")
            return False
        return True

    def perform(self, context):
        page = state.opened_bundle(context).report_page
        if not page.is_file():
            raise SceneError("the report is missing", where=page, cure="Run Refine or Evaluate again.")
        open_page(page)
        return f"Report: {page}"
