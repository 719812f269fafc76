"""A generated view's pictures side by side."""

from pathlib import Path

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty, StringProperty

from ...r2sego_blender.bridge.generation.view_pictures import compare_picture
from ...r2sego_blender.bridge.shared.image_editors import show_image
from ...r2sego_blender.results.panels.asset_renderings import renderings_of_view
from ...r2sego_blender.results.panels.view_parts import nearest_truth, view_parts
from ..base import ReportingOperator
from .properties import DEFAULT_PARTS, PARTS
from .views import OfOneView

IMAGE = "R2S-EGO Side by Side"


class R2SEGO_OT_compare_view(OfOneView, ReportingOperator, bpy.types.Operator):
    """Show asset, conditions, reference, generated frames and ground truth of a view side by side"""

    bl_idname = "r2sego.compare_view"
    bl_label = "Side by Side"
    bl_options = {"REGISTER", "UNDO"}  # else the next Ctrl-Z of anything takes the picture away

    parts: EnumProperty(
        name="Parts",
        description="What stands side by side; what is missing is left out",
        items=PARTS,
        options={"ENUM_FLAG"},
        default=DEFAULT_PARTS,
    )
    clip_frame: IntProperty(
        name="Clip Frame",
        description="Which frame of the clip; -1 takes the middle one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )
    truth: StringProperty(
        name="Ground Truth",
        subtype="FILE_PATH",
        description="A cameras.json whose nearest frozen view is shown; empty = the panel's",
    )

    def perform(self, context):
        bundle, shown, record = self.chosen(context)
        file = self.truth or context.scene.r2sego_generation.truth
        truth = None
        if file and "TRUTH" in self.parts:
            candidates = bundle.candidates(shown)
            truth = nearest_truth(
                Path(bpy.path.abspath(file)),
                np.array(bundle.scene.declaration.world_from_capture),
                candidates.poses[record.candidate],
            )
        parts = view_parts(
            bundle,
            record,
            {part.lower() for part in self.parts},
            clip_frame=self.clip_frame,
            asset=renderings_of_view(bundle, shown, record.rank),
            truth=truth,
        )
        image = compare_picture(IMAGE, parts)
        image["view"], image["round"] = record.rank, shown
        show_image(image)
        return f"View {record.rank}: {', '.join(image['parts'])}"
