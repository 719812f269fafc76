"""The materials of a style, of the demo's. Needs pip's ``bpy``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from demo.living_room import artworks
from demo.living_room.materials import (
    Shader,
    add_tiles,
    book_covers,
    cloth,
    colour,
    glaze,
    lampshade,
    leaf,
    metal,
    picture,
    planks,
    plaster,
    wood,
)

from .style import Colours, Style

_STRIPE_M, _CHECK_M, _BRICK_M, _TILE_M = 0.12, 0.16, (0.24, 0.075), 0.33

Material = Any
"""Of Blender, which has no types."""


@dataclass(frozen=True)
class Finishes:
    """Materials by what they are used for; of ``wood`` both directions of the grain, along x and upright."""

    wall: Material
    accent: Material
    floor: Material
    ceiling: Material
    white_paint: Material
    paper: Material
    books: Material
    soil: Material
    leaf: Material
    bark: Material
    metal: Material
    black: Material
    shade: Material
    rug: Material
    cardboard: Material
    wood: tuple[tuple[Material, Material], ...]
    cloth: tuple[Material, ...]
    glaze: tuple[Material, ...]


def make_finishes(style: Style, rng: np.random.Generator) -> Finishes:
    """All materials of a style, in an empty Blender file; ``rng`` draws textures and the rug."""
    add_tiles(rng)
    striped = rng.random(len(style.cloth)) < style.patterned_cloth
    return Finishes(
        wall=surface("wall", style.wall, upright=True),
        accent=surface("accent", style.accent, upright=True),
        floor=surface("floor", style.floor, upright=False),
        ceiling=plaster("ceiling", *style.ceiling),
        white_paint=glaze("white_paint", "#d8d2c6", "#f2eee6", 0.5),
        paper=glaze("paper", "#d6cbb5", "#efe7d6", 0.9),
        books=book_covers("books"),
        soil=cloth("soil", "#1d130c", "#4a3524", 50.0),
        leaf=leaf("leaf"),
        bark=wood("bark", "#4b3524", "#8a6a49", (12.0, 12.0, 4.0), 0.8),
        metal=metal("metal", style.metal),
        black=metal("black", "#1a1a1a", 0.25),
        shade=lampshade("shade", "#ffe3b0", 1.6),
        rug=picture("rug", artworks.kilim(rng, 600, 440), 0.95),
        cardboard=glaze("cardboard", "#8f6b45", "#b58c60", 0.9),
        wood=tuple(
            (wood(f"wood{i}", *tones, (1.0, 8.0, 8.0)), wood(f"wood{i} upright", *tones, (8.0, 8.0, 1.0)))
            for i, tones in enumerate(style.wood)
        ),
        cloth=tuple(
            _pattern(f"cloth{i}", tones, 0.05, (1.0, 1.0, 0.0)) if lined else cloth(f"cloth{i}", *tones)
            for i, (tones, lined) in enumerate(zip(style.cloth, striped, strict=True))
        ),
        glaze=tuple(glaze(f"glaze{i}", *tones) for i, tones in enumerate(style.glaze)),
    )


def surface(name: str, finish: tuple[str, Colours], upright: bool) -> Material:
    """A large surface; an ``upright`` one has its height along z. Raises KeyError for a finish that is none."""
    kind, (dark, light) = finish
    makers = {
        "plaster": lambda: plaster(name, dark, light),
        "plain": lambda: Shader(name, 0.9).finish(colour(light)),
        "cloth": lambda: cloth(name, dark, light, 40.0),
        "planks": lambda: planks(name, light, dark),
        "stripes": lambda: _pattern(name, (dark, light), _STRIPE_M, (1.0, 1.0, 0.0)),
        "checks": lambda: _pattern(name, (dark, light), _CHECK_M, (1.0, 1.0, 1.0)),
        "bricks": lambda: _bricks(name, (dark, light), _BRICK_M, upright, 0.5),
        "tiles": lambda: _bricks(name, (dark, light), (_TILE_M, _TILE_M), upright, 0.0),
    }
    return makers[kind]()


def _pattern(name: str, tones: Colours, width_m: float, along: tuple[float, float, float]) -> Material:
    """Stripes, or checks where the pattern runs ``along`` all axes."""
    shader = Shader(name, 0.9)
    moved = shader.node("VectorMath", Vector=shader.node("TexCoord").outputs["Object"])
    shader.feed(moved.inputs[1], (0.013, 0.017, 0.011))  # so that no face lies between two checks
    scaled = shader.node("Mapping", Vector=moved.outputs[0], Scale=tuple(share / width_m for share in along))
    squares = shader.node(
        "TexChecker", Vector=scaled.outputs[0], Color1=colour(tones[0]), Color2=colour(tones[1]), Scale=1.0
    )
    worn = shader.ramp(shader.texture("clouds", shader.place(), 1.3), [(0.3, "#e4e0da"), (0.7, "#ffffff")])
    return shader.finish(shader.mix(0.6, squares.outputs["Color"], worn, "MULTIPLY"))


def _bricks(name: str, tones: Colours, size_m: tuple[float, float], upright: bool, shifted: float) -> Material:
    """Bricks or tiles in rows, each of its own tone."""
    shader = Shader(name, 0.8 if upright else 0.35)
    axes = shader.node("SeparateXYZ", Vector=shader.node("TexCoord").outputs["Object"])
    flat = shader.node("CombineXYZ", X=axes.outputs["X"], Y=axes.outputs["Z" if upright else "Y"])
    rows = shader.node(
        "TexBrick",
        Vector=flat.outputs[0],
        Scale=1.0,
        Color1=colour(tones[0]),
        Color2=colour(tones[1]),
        Mortar=colour("#b9b3aa"),
        Mortar_Size=0.004,
        Mortar_Smooth=0.2,
        Bias=0.0,
        Brick_Width=size_m[0],
        Row_Height=size_m[1],
    )
    rows.offset = shifted
    worn = shader.ramp(shader.texture("clouds", shader.place(), 1.3), [(0.3, "#cfc8c0"), (0.7, "#ffffff")])
    return shader.finish(shader.mix(0.7, rows.outputs["Color"], worn, "MULTIPLY"))


def art(name: str, rng: np.random.Generator) -> Material:
    """One of the demo's pictures."""
    draw = (artworks.hills, artworks.arches, artworks.leaves)[int(rng.integers(3))]
    return picture(name, draw(rng, 210, 280))
