"""Show one of the bundle's assets as splats."""

import bpy
from bpy.props import StringProperty

from ...r2sego_blender.bridge.asset.show_asset import show_asset
from ...r2sego_blender.bridge.shared.views_3d import redraw_views
from ...r2sego_blender.bundle.asset_stages import stage_named
from ...r2sego_blender.core.errors import AssetError
from .. import state
from ..base import ReportingOperator, hint_if_hidden
from .facts import AssetFacts
from .marks import mark_again
from .polls import needs_asset


def show_stage(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    """Show the asset of a stage, and mark anew what is marked. Raises R2SEgoError."""
    bundle = state.bundle_of(scene)
    if bundle is None:
        raise AssetError("no scene is open", cure="Open one with Open Scene.")
    stage = stage_named(bundle.scene, name)
    group = scene.r2sego_asset
    group.shown = show_asset(scene, bundle, stage)
    if stage.name not in group.stages or group.older:  # written since the bundle was read
        state.read_again(scene, AssetFacts)
    group.stage = group.stages.find(stage.name)
    mark_again(scene)
    redraw_views()
    return group.shown


class R2SEGO_OT_show_asset(ReportingOperator, bpy.types.Operator):
    """Show the visual asset's splats in the 3D views; in Edit Mode they are points to select"""

    bl_idname = "r2sego.show_asset"
    bl_label = "Show Asset"
    bl_options = {"REGISTER", "UNDO"}

    stage: StringProperty(
        name="Asset", description="initial, a round's number, or final; empty = where the slider stands"
    )

    @classmethod
    def poll(cls, context):
        return needs_asset(cls, context)

    def perform(self, context):
        group = context.scene.r2sego_asset
        shown = show_stage(context.scene, self.stage or group.stages[group.stage].name)
        return f"{shown.name}: {len(shown.data.vertices)} splats{hint_if_hidden(context, shown)}"
