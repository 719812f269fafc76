"""The settings, a sub-panel of Scene: what the person changes overrides the preset."""

import bpy

from ..r2sego_blender.bridge.scene.settings_properties import preset_values, property_name, sections


class R2SEGO_PT_settings(bpy.types.Panel):
    """Every setting of the refinement; a changed one overrides the preset"""

    bl_idname = "R2SEGO_PT_settings"
    bl_label = "Settings"
    bl_parent_id = "R2SEGO_PT_scene"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_decorate = False
        group, preset = context.scene.r2sego.settings, context.scene.r2sego.preset
        of_preset = preset_values(preset)
        row = layout.row(align=True)
        row.operator_menu_enum("r2sego.load_settings", "name", text="Load", icon="PRESET")
        row.operator("r2sego.keep_settings", text="", icon="ADD")
        row.operator_menu_enum("r2sego.remove_settings", "name", text="", icon="REMOVE")
        layout.operator("r2sego.reset_settings", icon="LOOP_BACK")
        for section, keys in sections().items():
            header, body = layout.panel(f"R2SEGO_{section or 'general'}", default_closed=bool(section))
            header.label(text=(section or "general").capitalize())
            if body is None:
                continue
            for key in keys:
                name = property_name(key)
                row = body.row()
                changed = group.is_property_set(name)
                row.active = changed  # grey: the preset's value holds
                # A number's name stands in its field, where a long one has room; a choice's beside it.
                row.use_property_split = group.bl_rna.properties[name].type == "ENUM"
                row.prop(group, name)
                if key in of_preset and not changed:  # below the field, which has no room for it
                    told = body.row()
                    told.alignment = "RIGHT"
                    told.label(text=f"{preset.capitalize()}: {of_preset[key]}")


CLASSES = (R2SEGO_PT_settings,)
