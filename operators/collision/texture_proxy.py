"""Bake the captures' colours onto the proxy and show the textured mesh."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ...r2sego_blender.bridge.collision.show_collision import show_textured
from ...r2sego_blender.bridge.shared.declared_properties import declared_property
from ...r2sego_blender.bridge.shared.panel_facts import facts_of
from ...r2sego_blender.config.fields import fields_of
from ...r2sego_blender.config.settings import TextureSettings
from ...r2sego_blender.core.errors import SceneError
from .. import state
from ..base import EngineOperator, needs_idle_engine, needs_round
from .properties import CollisionFacts, tell

_FIELDS = fields_of(TextureSettings)


class R2SEGO_OT_texture_proxy(EngineOperator, bpy.types.Operator):
    """Write the proxy as one mesh with a texture baked from the captures, as GLB"""

    bl_idname = "r2sego.texture_proxy"
    bl_label = "Texture Proxy"
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="File", description="The .glb to write; empty = the bundle's own", subtype="FILE_PATH"
    )
    faces: declared_property(_FIELDS["faces"], "Faces", description="Faces the mesh keeps")
    size: declared_property(
        _FIELDS["size_px"], "Texture Size", description="Texels a side of the texture", subtype="PIXEL"
    )
    show: BoolProperty(name="Show", description="Show the textured mesh when it is there", default=True)

    @classmethod
    def poll(cls, context):
        return needs_round(cls, context) and needs_idle_engine(cls)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def arguments(self, context):
        command = [
            "texture",
            str(state.opened_bundle(context).path),
            "--faces",
            str(self.faces),
            "--size",
            str(self.size),
            "--json-progress",
        ]
        return [*command, "--to", bpy.path.abspath(self.filepath)] if self.filepath else command

    def finish(self, context, result):
        state.refresh(context.scene)
        if not result.get("file"):
            return "Textured"
        group = context.scene.r2sego_collision
        group.texture_of = facts_of(context.scene, CollisionFacts).proxy
        tell(group.texture_lines, _facts(result))
        if self.show:
            file = Path(result["file"])
            if not file.is_file():
                raise SceneError("the textured mesh is gone", where=file, cure="Texture again.")
            show_textured(context.scene, state.opened_bundle(context), file)
        return f"{Path(result['file']).name}: {result['megabytes']:.1f} MB"


def _facts(result) -> list[tuple[str, str]]:
    return [
        ("Textured", f"{result['faces']} faces, {result['size_px']} texels a side"),
        ("Seen", f"{result['seen']:.0%} of the surface by a capture"),
        ("Captures", f"{result['psnr_db']:.1f} dB on {result['covered']:.0%} of their pixels"),
    ]
