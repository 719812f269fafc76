"""Procedural materials: plaster, wood, cloth, glaze and pictures, each with visible texture.

Matching photographs needs texture at 1 to 20 cm: every large surface carries some, as real
rooms do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import bpy
import numpy as np

from . import artworks, textures


def colour(code: str) -> tuple[float, float, float, float]:
    """A linear RGBA colour of an sRGB code such as ``#c8a070``."""
    encoded = np.array([int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return (*map(float, linear), 1.0)


def new_image(name: str, pixels: np.ndarray, is_data: bool = False) -> bpy.types.Image:
    """A Blender image of (H, W, 3) sRGB pixels or, as data, of (H, W) grey; packed."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, is_data=is_data)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels[..., None] if is_data else pixels
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.update()
    image.pack()
    return image


class Shader:
    """A material under construction: nodes are added by kind, inputs set or linked by name."""

    def __init__(self, name: str, roughness: float = 0.6) -> None:
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.surface = self.tree.nodes["Principled BSDF"]
        self.surface.inputs["Roughness"].default_value = roughness

    def node(self, kind: str, **inputs) -> bpy.types.Node:
        """A new ``ShaderNode<kind>``; an input that is a socket is linked, a value is set."""
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            self.feed(node.inputs[name.replace("_", " ")], value)
        return node

    def feed(self, socket: bpy.types.NodeSocket, value) -> None:
        """Link or set one input."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def place(self, scale: Sequence[float] = (1, 1, 1)) -> bpy.types.NodeSocket:
        """Object coordinates in metres times ``scale``, shifted at random for each object."""
        object_info = self.node("ObjectInfo")
        shift = self.node("Math", Value=object_info.outputs["Random"])
        shift.operation = "MULTIPLY"
        shift.inputs[1].default_value = 37.0
        coordinates = self.node("TexCoord").outputs["Object"]
        moved = self.node("VectorMath", Vector=coordinates)
        self.feed(moved.inputs[1], shift.outputs[0])
        return self.node("Mapping", Vector=moved.outputs[0], Scale=tuple(scale)).outputs[0]

    def texture(self, tile: str, place: bpy.types.NodeSocket, per_metre: float) -> bpy.types.NodeSocket:
        """A grey tile in [0, 1], ``clouds``, ``strokes`` or ``yarns``, repeated ``per_metre`` times a metre.

        The tile is projected along the axes of the object, blended where a surface turns.
        """
        scaled = self.node("VectorMath", Vector=place)
        scaled.operation = "SCALE"
        self.feed(scaled.inputs["Scale"], per_metre)
        lookup = self.node("TexImage", Vector=scaled.outputs[0])
        lookup.image = bpy.data.images[tile]
        lookup.projection = "BOX"
        lookup.projection_blend = 0.25
        return lookup.outputs["Color"]

    def ramp(
        self, factor: bpy.types.NodeSocket, stops: Sequence[tuple[float, str]], stepped: bool = False
    ) -> bpy.types.NodeSocket:
        """Colours along ``factor``, blended or stepped; ``stops`` are (position, colour code), ascending."""
        node = self.node("ValToRGB", Fac=factor)
        node.color_ramp.interpolation = "CONSTANT" if stepped else "LINEAR"
        elements = node.color_ramp.elements
        elements.remove(elements[1])
        elements[0].position = stops[0][0]
        elements[0].color = colour(stops[0][1])
        for position, code in stops[1:]:
            elements.new(position).color = colour(code)
        return node.outputs["Color"]

    def mix(self, factor, first, second, blend: str = "MIX") -> bpy.types.NodeSocket:
        """Two colours mixed."""
        node = self.node("Mix")
        node.data_type = "RGBA"
        node.blend_type = blend
        for socket, value in zip(
            (node.inputs[0], node.inputs[6], node.inputs[7]), (factor, first, second), strict=True
        ):
            self.feed(socket, value)
        return node.outputs[2]

    def bump(self, height: bpy.types.NodeSocket, depth_m: float, strength: float = 1.0) -> None:
        """Relief of ``depth_m`` under the light."""
        bump = self.node("Bump", Height=height, Strength=strength, Distance=depth_m)
        self.feed(self.surface.inputs["Normal"], bump.outputs[0])

    def finish(self, base_colour) -> bpy.types.Material:
        """Set the base colour; the material."""
        self.feed(self.surface.inputs["Base Color"], base_colour)
        return self.material


def plaster(name: str, dark: str, light: str) -> bpy.types.Material:
    """Hand-trowelled plaster: soft clouds and strokes."""
    shader = Shader(name, roughness=0.92)
    place = shader.place()
    clouds = shader.texture("clouds", place, 0.27)
    trowel = shader.texture("strokes", place, 0.9)
    shader.bump(trowel, 0.006, strength=0.5)
    broad = shader.ramp(clouds, [(0.3, dark), (0.7, light)])
    fine = shader.ramp(trowel, [(0.25, dark), (0.75, light)])
    return shader.finish(shader.mix(0.6, broad, fine))


def planks(name: str, light: str = "#bd9160", dark: str = "#93673b", gap: str = "#2e1c10") -> bpy.types.Material:
    """Floor boards, 13 cm wide, of oak unless other colours are given."""
    shader = Shader(name, roughness=0.42)
    boards = shader.node(
        "TexBrick",
        Vector=shader.node("TexCoord").outputs["Object"],
        Scale=1.0,
        Color1=colour(light),
        Color2=colour(dark),
        Mortar=colour(gap),
        Mortar_Size=0.0022,
        Mortar_Smooth=0.3,
        Bias=-0.1,
        Brick_Width=1.35,
        Row_Height=0.13,
    )
    boards.offset = 0.37
    grain = shader.texture("strokes", shader.place((1.0, 9.0, 1.0)), 0.55)
    stained = shader.texture("clouds", shader.place((1.0, 3.0, 1.0)), 0.4)
    fibres = shader.ramp(grain, [(0.28, "#a3907a"), (0.6, "#ffffff")])
    stains = shader.ramp(stained, [(0.3, "#bba890"), (0.62, "#ffffff")])
    wood = shader.mix(0.75, boards.outputs["Color"], fibres, "MULTIPLY")
    return shader.finish(shader.mix(0.8, wood, stains, "MULTIPLY"))


def wood(name: str, dark: str, light: str, grain: Sequence[float], roughness: float = 0.42) -> bpy.types.Material:
    """Solid wood; ``grain`` is 1 along the fibres and large across them."""
    shader = Shader(name, roughness)
    fibres = shader.texture("strokes", shader.place(grain), 0.75)
    return shader.finish(shader.ramp(fibres, [(0.25, dark), (0.46, light), (0.56, dark), (0.75, light)]))


def cloth(name: str, dark: str, light: str, threads: float = 70.0) -> bpy.types.Material:
    """Woven upholstery: mottled yarns with about ``threads`` knots a metre."""
    shader = Shader(name, roughness=0.95)
    place = shader.place()
    weave = shader.texture("yarns", place, threads / 40)
    mottle = shader.texture("clouds", place, 1.7)
    fine = shader.ramp(weave, [(0.25, dark), (0.85, light)])
    broad = shader.ramp(mottle, [(0.3, dark), (0.7, light)])
    shader.surface.inputs["Sheen Weight"].default_value = 0.25
    shader.bump(weave, 0.004, strength=0.45)
    return shader.finish(shader.mix(0.55, fine, broad))


def glaze(name: str, dark: str, light: str, roughness: float = 0.35) -> bpy.types.Material:
    """Speckled ceramic or lacquer."""
    shader = Shader(name, roughness)
    speckles = shader.texture("clouds", shader.place(), 6.0)
    return shader.finish(shader.ramp(speckles, [(0.36, dark), (0.55, light)]))


def metal(name: str, code: str, roughness: float = 0.35) -> bpy.types.Material:
    """Brushed metal or painted steel."""
    shader = Shader(name, roughness)
    shader.surface.inputs["Metallic"].default_value = 0.9
    return shader.finish(colour(code))


def leaf(name: str) -> bpy.types.Material:
    """Leaves with a pale midrib; ``u`` runs across the leaf."""
    shader = Shader(name, roughness=0.4)
    uv = shader.node("SeparateXYZ", Vector=shader.node("TexCoord").outputs["UV"])
    across = shader.ramp(
        uv.outputs["X"], [(0.0, "#2f5a2a"), (0.46, "#3f7434"), (0.5, "#a9c07a"), (0.54, "#3f7434"), (1.0, "#2a5226")]
    )
    patches = shader.ramp(shader.texture("clouds", shader.place(), 1.8), [(0.35, "#8fa58c"), (0.65, "#ffffff")])
    return shader.finish(shader.mix(0.85, across, patches, "MULTIPLY"))


def book_covers(name: str) -> bpy.types.Material:
    """Cloth-bound books: each object takes its own colour, with a title band on the spine."""
    shader = Shader(name, roughness=0.75)
    palette = ["#8c3b2b", "#d9c7a3", "#27465a", "#c98a2c", "#54663f", "#efe6d2", "#6b2f3c", "#3b3a3a"]
    own = shader.node("ObjectInfo").outputs["Random"]
    covers = shader.ramp(own, [(i / len(palette), code) for i, code in enumerate(palette)], stepped=True)
    height = shader.node("SeparateXYZ", Vector=shader.node("TexCoord").outputs["Generated"]).outputs["Z"]
    off, on = "#000000", "#ffffff"
    bands = shader.ramp(
        height, [(0.0, off), (0.12, on), (0.15, off), (0.66, on), (0.8, off), (0.86, on), (0.88, off)], stepped=True
    )
    worn = shader.ramp(shader.texture("clouds", shader.place(), 5.0), [(0.35, "#b9b2a8"), (0.6, "#ffffff")])
    titled = shader.mix(bands, covers, colour("#d8b871"))
    return shader.finish(shader.mix(0.7, titled, worn, "MULTIPLY"))


def picture(name: str, pixels: np.ndarray, roughness: float = 0.7) -> bpy.types.Material:
    """An (H, W, 3) sRGB image in [0, 1] on a panel's UV, packed into the .blend file."""
    shader = Shader(name, roughness)
    image = new_image(name, pixels)
    texture = shader.node("TexImage", Vector=shader.node("TexCoord").outputs["UV"])
    texture.image = image
    return shader.finish(texture.outputs["Color"])


def lampshade(name: str, code: str, strength: float) -> bpy.types.Material:
    """Linen lit from within."""
    shader = Shader(name, roughness=0.9)
    weave = shader.texture("strokes", shader.place((1.0, 1.0, 0.2)), 5.0)
    linen = shader.ramp(weave, [(0.35, "#d9b98a"), (0.65, code)])
    shader.feed(shader.surface.inputs["Emission Color"], linen)
    shader.surface.inputs["Emission Strength"].default_value = strength
    return shader.finish(linen)


def sheer_curtain(name: str) -> bpy.types.Material:
    """Thin linen: half of the light that falls on it passes through."""
    shader = Shader(name, roughness=1.0)
    threads = shader.texture("strokes", shader.place((6.0, 6.0, 1.0)), 1.0)
    linen = shader.ramp(threads, [(0.35, "#d8cdb8"), (0.65, "#f6efe2")])
    through = shader.node("BsdfTranslucent", Color=linen)
    shader.feed(shader.surface.inputs["Base Color"], linen)
    both = shader.node("MixShader", Fac=0.5)
    shader.feed(both.inputs[1], shader.surface.outputs[0])
    shader.feed(both.inputs[2], through.outputs[0])
    shader.feed(shader.tree.nodes["Material Output"].inputs["Surface"], both.outputs[0])
    return shader.material


@dataclass(frozen=True)
class Palette:
    """Every material of the room, by what it is used for."""

    wall: bpy.types.Material
    accent_wall: bpy.types.Material
    ceiling: bpy.types.Material
    floor: bpy.types.Material
    white_paint: bpy.types.Material
    curtain: bpy.types.Material
    walnut: bpy.types.Material
    walnut_upright: bpy.types.Material
    oak: bpy.types.Material
    oak_upright: bpy.types.Material
    rust_cloth: bpy.types.Material
    cream_cloth: bpy.types.Material
    mustard_cloth: bpy.types.Material
    navy_cloth: bpy.types.Material
    rug: bpy.types.Material
    rug_edge: bpy.types.Material
    stripes: bpy.types.Material
    terracotta: bpy.types.Material
    stoneware: bpy.types.Material
    blue_glaze: bpy.types.Material
    soil: bpy.types.Material
    leaf: bpy.types.Material
    bark: bpy.types.Material
    books: bpy.types.Material
    paper: bpy.types.Material
    brass: bpy.types.Material
    black_steel: bpy.types.Material
    shade: bpy.types.Material
    basket: bpy.types.Material


def add_tiles(rng: np.random.Generator) -> None:
    """The grey tiles that ``Shader.texture`` looks up."""
    for name, draw in (("clouds", textures.fractal), ("strokes", textures.strokes), ("yarns", textures.yarns)):
        new_image(name, draw(rng), is_data=True)


def make_palette(seed: int) -> Palette:
    """All materials; ``seed`` draws the rug's and the cloths' patterns."""
    rng = np.random.default_rng(seed)
    add_tiles(rng)
    made = {
        "wall": plaster("wall", "#cfc3ae", "#ece3d2"),
        "accent_wall": plaster("accent_wall", "#75866f", "#98a78e"),
        "ceiling": plaster("ceiling", "#dcd8cf", "#f1eee7"),
        "floor": planks("floor"),
        "white_paint": glaze("white_paint", "#d8d2c6", "#f2eee6", 0.5),
        "curtain": sheer_curtain("curtain"),
        "walnut": wood("walnut", "#3f2415", "#7b4f2e", (1.0, 8.0, 8.0)),
        "walnut_upright": wood("walnut_upright", "#3f2415", "#7b4f2e", (8.0, 8.0, 1.0)),
        "oak": wood("oak", "#9a7243", "#cfa871", (1.0, 8.0, 8.0)),
        "oak_upright": wood("oak_upright", "#9a7243", "#cfa871", (8.0, 8.0, 1.0)),
        "rust_cloth": cloth("rust_cloth", "#7d3520", "#b8603c"),
        "cream_cloth": cloth("cream_cloth", "#b9a987", "#efe5cf", 55.0),
        "mustard_cloth": cloth("mustard_cloth", "#96661a", "#d9a43c"),
        "navy_cloth": cloth("navy_cloth", "#1d2c40", "#48617e"),
        "rug": picture("rug", artworks.kilim(rng), 0.95),
        "rug_edge": cloth("rug_edge", "#8d7c61", "#d9c9a8", 90.0),
        "stripes": cloth("stripes", "#c9b48e", "#f0e6d2", 60.0),
        "terracotta": glaze("terracotta", "#8f4a2e", "#c07650", 0.8),
        "stoneware": glaze("stoneware", "#6d6357", "#d5cab8", 0.5),
        "blue_glaze": glaze("blue_glaze", "#1d3b54", "#3f7391", 0.25),
        "soil": cloth("soil", "#1d130c", "#4a3524", 50.0),
        "leaf": leaf("leaf"),
        "bark": wood("bark", "#4b3524", "#8a6a49", (12.0, 12.0, 4.0), 0.8),
        "books": book_covers("books"),
        "paper": glaze("paper", "#d6cbb5", "#efe7d6", 0.9),
        "brass": metal("brass", "#b38a45"),
        "black_steel": metal("black_steel", "#232323", 0.5),
        "shade": lampshade("shade", "#ffe3b0", 1.6),
        "basket": cloth("basket", "#6f4c27", "#c79a5f", 45.0),
    }
    return Palette(**{field.name: made[field.name] for field in fields(Palette)})
