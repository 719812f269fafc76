"""Plain materials whose viewport colour and rendered colour are the same."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.colours import linear_from_srgb

# Anchors of viridis, dark to light; linear between them.
_RAMP = np.array(
    [
        [0.267, 0.005, 0.329],
        [0.283, 0.141, 0.458],
        [0.254, 0.265, 0.530],
        [0.207, 0.372, 0.553],
        [0.164, 0.471, 0.558],
        [0.128, 0.567, 0.551],
        [0.135, 0.659, 0.518],
        [0.267, 0.749, 0.441],
        [0.478, 0.821, 0.318],
        [0.741, 0.873, 0.150],
        [0.993, 0.906, 0.144],
    ]
)


def plain_material(name: str, srgb: tuple[float, float, float]) -> bpy.types.Material:
    """The material of this name in this colour (sRGB in [0, 1]); made when it is missing."""
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    if not material.use_nodes:
        material.use_nodes = True
    colour = (*linear_from_srgb(np.array(srgb)).tolist(), 1.0)
    material.diffuse_color = colour
    material.roughness = 1.0
    shader = next((n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED"), None)
    if shader is not None:
        shader.inputs["Base Color"].default_value = colour
        shader.inputs["Roughness"].default_value = 0.9
    return material


def attribute_material(name: str, attribute: str) -> bpy.types.Material:
    """The material of this name, coloured by a colour attribute of the geometry."""
    material = bpy.data.materials.get(name)
    if material is not None:
        return material
    material = bpy.data.materials.new(name)
    if not material.use_nodes:
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    colour, shader = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    colour.attribute_name = attribute
    material.node_tree.links.new(colour.outputs["Color"], shader.inputs["Color"])
    material.node_tree.links.new(shader.outputs["Emission"], output.inputs["Surface"])
    return material


def ramp_materials(prefix: str, steps: int) -> list[bpy.types.Material]:
    """``steps`` materials from dark blue (low) to yellow (high).

    Steps and not one attribute, because the solid viewport shows materials as they are.
    """
    places = np.linspace(0.0, 1.0, steps)
    anchors = np.linspace(0.0, 1.0, len(_RAMP))
    colours = np.stack([np.interp(places, anchors, _RAMP[:, c]) for c in range(3)], axis=1)
    return [plain_material(f"{prefix} {i + 1}/{steps}", tuple(c)) for i, c in enumerate(colours)]
