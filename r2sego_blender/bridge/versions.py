"""Where Blender 4.3 to 5.x differ, for what this project uses. No other module asks for the version."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import bpy

_FROM_5_0 = bpy.app.version >= (5, 0, 0)

MATERIAL_INDEX_PASS = "Material Index" if _FROM_5_0 else "IndexMA"
"""The render layer's socket of the material-index pass."""


def write_passes(scene: bpy.types.Scene, folder: Path, passes: Mapping[str, str]) -> None:
    """Have renders of ``scene`` write each pass as ``folder/<name>_####.exr``, 32-bit floats.

    ``passes`` names, for each file, the socket of the render layer.
    """
    tree = _compositor(scene)
    layers = tree.nodes.new("CompositorNodeRLayers")
    layers.scene = scene
    for name, socket in passes.items():
        output = tree.nodes.new("CompositorNodeOutputFile")
        if _FROM_5_0:
            output.format.media_type = "IMAGE"
        output.format.file_format = "OPEN_EXR"
        output.format.color_depth = "32"
        if _FROM_5_0:
            output.directory, output.file_name = str(folder), f"{name}_"
            output.file_output_items.clear()
            output.file_output_items.new("VECTOR" if name == "normal" else "FLOAT", "")
        else:
            output.base_path = str(folder)
            output.file_slots[0].path = f"{name}_"
        tree.links.new(layers.outputs[socket], output.inputs[0])
    scene.render.use_sequencer = False


def remove_passes(scene: bpy.types.Scene) -> None:
    """Take away what ``write_passes`` made outside the scene."""
    if _FROM_5_0 and scene.compositing_node_group is not None:
        bpy.data.node_groups.remove(scene.compositing_node_group)


def _compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    if _FROM_5_0:
        scene.compositing_node_group = bpy.data.node_groups.new(scene.name, "CompositorNodeTree")
        return scene.compositing_node_group
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree
