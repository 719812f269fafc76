"""Print a study's plan as a page."""

from pathlib import Path

import bpy

from ...r2sego_blender.core.errors import TrialError
from ..base import EngineOperator, needs_idle_engine
from ..web_page import open_page
from . import facts
from .polls import needs_study


class R2SEGO_OT_open_trials_page(EngineOperator, bpy.types.Operator):
    """Write the plan as one printable page, with a floor plan for each pose, and open it in the web browser"""

    bl_idname = "r2sego.open_trials_page"
    bl_label = "Printable Page"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        return needs_study(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        return ["trials", "page", facts.study_path(context.scene), "--json-progress"]

    def finish(self, context, result):
        page = Path(result.get("page", ""))
        if not page.is_file():
            raise TrialError("the page is missing", where=page, cure="Write it again.")
        open_page(page)
        return f"Page: {page}"
