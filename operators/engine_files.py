"""Files that Blender hands to the engine: in Blender's temporary folder, gone with it."""

import tempfile
from pathlib import Path

import bpy

from ..r2sego_blender.geometry.object_names import plain_name


def handed_over(name: str) -> Path:
    """A path for a file, or a folder made by the caller, in a fresh folder of its own."""
    return Path(tempfile.mkdtemp(prefix="r2sego-", dir=bpy.app.tempdir or None)) / plain_name(name)
