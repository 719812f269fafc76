"""Where Blender 4.3 to 5.x differ, for what this project uses. No other module asks for the version."""

from __future__ import annotations

from pathlib import Path

import bpy

_FROM_4_5 = bpy.app.version >= (4, 5, 0)
_FROM_5_0 = bpy.app.version >= (5, 0, 0)

VERSION = ".".join(map(str, bpy.app.version))
"""This Blender's version, such as 4.5.15."""

RENDER_ENGINES = {"cycles": "CYCLES", "eevee": "BLENDER_EEVEE" if _FROM_5_0 else "BLENDER_EEVEE_NEXT"}
"""Blender's names of the engines."""

AFTER_IMPORT: list = getattr(bpy.app.handlers, "blend_import_post", [])
"""Handlers that are called when something was appended or linked; of no use where Blender has none."""


def render_filepath(file: Path) -> str:
    """``file`` as a render's path, in whose folders Blender 4.5 takes {…} for a variable."""
    return str(file).replace("{", "{{").replace("}", "}}") if _FROM_4_5 else str(file)


def write_multilayer(scene: bpy.types.Scene) -> None:
    """Have renders of ``scene`` write all passes into one EXR of 32-bit floats."""
    image = scene.render.image_settings
    if _FROM_5_0:
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"
    image.exr_codec = "ZIP"
    if _FROM_5_0:
        image.use_exr_interleave = True  # one part, as before; many readers open only the first
