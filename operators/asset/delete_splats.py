"""Delete the marked splats from the asset, restore deleted ones, or forget the marks."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.core.errors import AssetError
from .. import state
from ..base import EngineOperator, ReportingOperator, needs_bundle, needs_idle_engine
from ..engine_files import hand_over
from .marks import clear_marks
from .polls import needs_no_edit_mode
from .show_asset import show_stage


class R2SEGO_OT_delete_splats(EngineOperator, bpy.types.Operator):
    """Delete what is marked from the final asset, now and whenever the scene is refined again"""

    bl_idname = "r2sego.delete_splats"
    bl_label = "Delete Marked"
    bl_options = {"REGISTER"}

    name: StringProperty(name="Name", description="What the bundle calls this deletion; empty = the next edit_001")

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego_asset.marks:
            cls.poll_message_set("Nothing is marked: mark splats in a box or with the lasso first")
            return False
        return True

    def arguments(self, context):
        bundle = state.opened_bundle(context).path
        command = ["edit-asset", str(bundle)]
        for index, mark in enumerate(context.scene.r2sego_asset.marks):
            command += [f"--{mark.kind}", str(hand_over(f"{index:03d}.json", mark.region))]
        return [*command, *(["--name", self.name] if self.name else []), "--json-progress"]

    def finish(self, context, result):
        clear_marks(context.scene)
        return _show_edited(context, result)


class R2SEGO_OT_restore_splats(EngineOperator, bpy.types.Operator):
    """Take a deletion back: its splats return to the final asset"""

    bl_idname = "r2sego.restore_splats"
    bl_label = "Restore Splats"
    bl_options = {"REGISTER"}

    name: StringProperty(
        name="Name", description="The deletion; empty = the one chosen in the list", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        if not (needs_bundle(cls, context) and needs_idle_engine(cls)):
            return False
        if not context.scene.r2sego_asset.edits:
            cls.poll_message_set("Nothing was deleted yet: mark splats and press Delete Marked first")
            return False
        return True

    def arguments(self, context):
        group = context.scene.r2sego_asset
        name = self.name or group.edits[min(group.edit_index, len(group.edits) - 1)].name
        if name not in group.edits:
            raise AssetError(f"there is no deletion '{name}'", cure="Choose one of the list.")
        return ["edit-asset", str(state.opened_bundle(context).path), "--remove", name, "--json-progress"]

    def finish(self, context, result):
        return _show_edited(context, result)


class R2SEGO_OT_clear_splat_marks(ReportingOperator, bpy.types.Operator):
    """Mark nothing: no splat is deleted"""

    bl_idname = "r2sego.clear_splat_marks"
    bl_label = "Clear Marks"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not context.scene.r2sego_asset.marks:
            cls.poll_message_set("Nothing is marked: there are no marks to clear")
            return False
        return needs_no_edit_mode(cls, context)

    def perform(self, context):
        clear_marks(context.scene)
        return ""


def _show_edited(context, result) -> str:
    """Read the bundle again and show its final asset where an asset is shown and not in Edit Mode."""
    state.refresh(context.scene)
    group = context.scene.r2sego_asset
    if group.shown is not None and group.stages:
        last = len(group.stages) - 1
        if group.shown.mode == "EDIT":
            group.stage = last
        else:
            show_stage(context.scene, group.stages[last].name)
    if "gaussians" not in result:
        return "Kept: the next Refine leaves these splats out"
    return f"{result['gaussians']} of {result['before']} splats are left"
