"""Settings under a name of the person's own: kept, taken again, removed."""

import bpy
from bpy.props import EnumProperty, StringProperty

from ...r2sego_blender.bridge.engine.user_folder import user_folder
from ...r2sego_blender.bridge.scene.settings_properties import overrides, show_settings
from ...r2sego_blender.config.kept_settings import keep_settings, kept_settings, read_settings, remove_settings
from ...r2sego_blender.config.presets import preset, with_overrides
from ...r2sego_blender.core.errors import SettingsError
from ..base import ReportingOperator

_FOLDER = "settings"
_items: list[tuple[str, str, str]] = []  # Blender keeps no copy of an enumeration's texts


def _kept(operator, context):
    _items[:] = [(name, name, f"The settings kept as {name}") for name in kept_settings(user_folder(_FOLDER))]
    return _items


def _chosen(operator) -> str:
    """The name an operator is asked for. Raises SettingsError when none are kept."""
    if not kept_settings(user_folder(_FOLDER)):
        raise SettingsError("no settings are kept", cure="Keep some under a name first.")
    return operator.name


class R2SEGO_OT_keep_settings(ReportingOperator, bpy.types.Operator):
    """Keep the preset and the changed settings under a name, for other scenes too"""

    bl_idname = "r2sego.keep_settings"
    bl_label = "Keep Settings"
    bl_options = {"REGISTER"}

    name: StringProperty(name="Name", description="What they are called", default="My Settings")

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def perform(self, context):
        scene = context.scene.r2sego
        keep_settings(user_folder(_FOLDER), self.name, scene.preset, overrides(scene.settings, scene.preset))
        return f"Kept as {self.name}"


class R2SEGO_OT_load_settings(ReportingOperator, bpy.types.Operator):
    """Take the preset and the changed settings that were kept under a name"""

    bl_idname = "r2sego.load_settings"
    bl_label = "Load Settings"
    bl_options = {"REGISTER", "UNDO"}

    name: EnumProperty(name="Name", description="Which settings", items=_kept)

    def perform(self, context):
        scene, name = context.scene.r2sego, _chosen(self)
        chosen, changed = read_settings(user_folder(_FOLDER), name)
        scene.preset = chosen
        show_settings(scene.settings, changed, with_overrides(changed, preset(chosen)))
        return f"Settings: {name}"


class R2SEGO_OT_remove_settings(ReportingOperator, bpy.types.Operator):
    """Remove settings that were kept under a name"""

    bl_idname = "r2sego.remove_settings"
    bl_label = "Remove Settings"
    bl_options = {"REGISTER"}

    name: EnumProperty(name="Name", description="Which settings", items=_kept)

    def perform(self, context):
        name = _chosen(self)  # Blender keeps its place in the list, where another stands afterwards
        remove_settings(user_folder(_FOLDER), name)
        return f"Removed {name}"
