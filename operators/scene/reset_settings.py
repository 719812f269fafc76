"""Forget the settings a person has changed."""

import bpy

from ...r2sego_blender.bridge.scene.settings_properties import show_settings
from ...r2sego_blender.config.settings import Settings
from ..base import ReportingOperator


class R2SEGO_OT_reset_settings(ReportingOperator, bpy.types.Operator):
    """Forget every changed setting, so that the preset's own hold"""

    bl_idname = "r2sego.reset_settings"
    bl_label = "Reset Settings"
    bl_options = {"REGISTER", "UNDO"}

    def perform(self, context):
        show_settings(context.scene.r2sego.settings, {}, Settings())
        return ""
