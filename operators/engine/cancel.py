"""Cancel the running command of the engine."""

import bpy

from .. import job

_keymaps = []


class R2SEGO_OT_cancel(bpy.types.Operator):
    """Cancel what the engine is doing, as ESC does over a 3D view; finished steps are kept"""

    bl_idname = "r2sego.cancel"
    bl_label = "Cancel"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not job.is_running():
            cls.poll_message_set("The engine is idle: there is nothing to cancel")
            return False
        return True

    def invoke(self, context, event):
        if event.type == "ESC" and context.screen.is_animation_playing:
            return {"PASS_THROUGH"}  # which ESC ends first
        return self.execute(context)

    def execute(self, context):
        job.cancel()
        return {"FINISHED"}


def register() -> None:
    """ESC over a 3D view, wherever no other action takes it; nothing happens while the engine is idle."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is not None:  # there is none in background
        keymap = configuration.keymaps.new(name="3D View Generic", space_type="VIEW_3D")
        _keymaps.append((keymap, keymap.keymap_items.new(R2SEGO_OT_cancel.bl_idname, "ESC", "PRESS")))


def unregister() -> None:
    """Take the key away again."""
    while _keymaps:
        keymap, item = _keymaps.pop()
        keymap.keymap_items.remove(item)
