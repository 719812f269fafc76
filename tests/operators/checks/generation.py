"""What holds of the room Generation, checked inside Blender."""

import json

import bpy
from support import OUT, open_bundle, refused, state

OPERATORS = {"render_conditions"}


def check_conditions_are_rendered():
    open_bundle()
    state().round_index = 0
    folder = OUT.parent / "conditions"
    assert bpy.ops.r2sego.render_conditions(view=0, directory=str(folder), scale=50) == {"FINISHED"}
    names = sorted(file.name for file in folder.iterdir())
    assert names == ["000.exr", "001.exr", "002.exr", "003.exr", "manifest.json"], names
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["complete"] and manifest["renderer"].startswith("Cycles "), manifest
    camera = manifest["frames"][3]["camera"]
    assert (camera["width"], camera["height"]) == (40, 30), camera
    assert (folder / "003.exr").read_bytes()[:4] == b"v/1\x01"  # OpenEXR; Blender reads no layers
    assert "views" in refused(bpy.ops.r2sego.render_conditions, view=5, directory=str(folder))
