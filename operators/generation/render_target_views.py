"""Render the asset from the target views, to stand beside what was generated there."""

import json

import bpy
from bpy.props import EnumProperty

from ...r2sego_blender.results.panels.asset_renderings import prune, stage_beside, views_folder
from ...r2sego_blender.results.panels.view_parts import views_of_round
from .. import state
from ..base import EngineOperator, needs_idle_engine
from ..engine_files import hand_over
from .views import needs_views

_WHEN = [
    ("BEFORE", "Before the Round", "The asset that lacks what the views show"),
    ("AFTER", "After the Round", "The asset that was trained on the views"),
]


class R2SEGO_OT_render_target_views(EngineOperator, bpy.types.Operator):
    """Render the asset exactly from all generated views, for the comparison side by side"""

    bl_idname = "r2sego.render_target_views"
    bl_label = "Render Asset from Views"
    bl_options = {"REGISTER"}

    when: EnumProperty(name="Asset", description="Which asset is rendered", items=_WHEN)

    @classmethod
    def poll(cls, context):
        return needs_views(cls, context) and needs_idle_engine(cls)

    def arguments(self, context):
        bundle, shown = state.opened_bundle(context), context.scene.r2sego.round_index
        stage = stage_beside(bundle, shown, self.when)
        candidates = bundle.candidates(shown)
        cameras = [
            {"name": f"{record.rank:03d}", **candidates.camera.at(candidates.poses[record.candidate]).to_json()}
            for record in views_of_round(bundle, shown)
        ]
        file = hand_over("cameras.json", json.dumps({"cameras": cameras}))
        folder = views_folder(bundle, shown, stage)
        return [
            "render",
            str(bundle.path),
            "--cameras",
            str(file),
            "--to",
            str(folder),
            "--round",
            stage.name,
            "--json-progress",
        ]

    def finish(self, context, result):
        prune(state.opened_bundle(context))
        state.refresh(context.scene)
        return f"{len(result.get('files', ()))} pictures of the asset {self.when.lower()} the round"
