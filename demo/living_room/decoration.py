"""Decoration: pictures, lamps, plant, and what stands on the sideboard and the sills."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np

from . import artworks
from .architecture import EAST_M, NORTH_M
from .build import ON_WALL, Piece, grid_mesh
from .materials import Palette, picture

GOLDEN_ANGLE = pi * (3 - 5**0.5)


def add_decoration(palette: Palette, rng: np.random.Generator) -> None:
    """Pictures, lamps, the plant and small things."""
    add_pictures(palette, rng)
    add_floor_lamp(palette)
    add_plant(palette, rng)
    add_sideboard_things(palette)
    add_basket(palette)


def add_pictures(palette: Palette, rng: np.random.Generator) -> None:
    """Three prints above the sofa, and a large canvas above the sideboard."""
    frames = (
        ("hills", artworks.hills(rng), (-1.22, 1.62)),
        ("arches", artworks.arches(rng), (-0.55, 1.66)),
        ("leaves", artworks.leaves(rng), (0.12, 1.62)),
    )
    for name, pixels, (x, z) in frames:
        piece = Piece(f"picture {name}", (x, NORTH_M))
        framed(piece, picture(name, pixels), (0.48, 0.64), z, palette.oak, palette.paper)
    canvas = Piece("picture canvas", (EAST_M, 0.55), -90.0)
    field = picture("colour field", artworks.colour_field(rng))
    framed(canvas, field, (1.05, 0.7), 1.62, palette.walnut, palette.paper)


def framed(piece: Piece, shown, size: tuple[float, float], z: float, frame, paper) -> None:
    """A picture's material with a passe-partout in a frame, hanging on the piece's back plane (y = 0)."""
    width, height = size
    bar, depth = 0.028, 0.03
    piece.box((0, -0.008, z), (width, 0.012, height), paper, bevel=0)
    border = 0.05
    piece.panel((0, -0.0155, z), (width - 2 * border, height - 2 * border), shown, ON_WALL)
    for side in (-1, 1):
        piece.box((side * width / 2, -depth / 2, z), (bar, depth, height + bar), frame, bevel=0.003)
        piece.box((0, -depth / 2, z + side * height / 2), (width - bar, depth, bar), frame, bevel=0.003)


def add_floor_lamp(palette: Palette) -> None:
    """A brass lamp with a linen shade between the sofa and the bookshelf."""
    lamp = Piece("floor lamp", (0.78, NORTH_M - 0.32))
    lamp.turned((0, 0, 0), [(0, 0), (0.15, 0), (0.15, 0.018), (0.03, 0.03), (0, 0.03)], palette.brass)
    lamp.beam((0, 0, 0.02), (0, 0, 1.42), (0.012, 0.012), palette.brass)
    lamp.turned((0, 0, 1.32), [(0.215, 0.0), (0.15, 0.3)], palette.shade, sides=56)


def add_plant(palette: Palette, rng: np.random.Generator) -> None:
    """A rubber fig in a terracotta pot, in the north-west corner."""
    plant = Piece("plant", (-2.08, NORTH_M - 0.42))
    pot = [(0, 0), (0.14, 0), (0.19, 0.3), (0.205, 0.3), (0.205, 0.35), (0.185, 0.35), (0.175, 0.31), (0, 0.31)]
    plant.turned((0, 0, 0), pot, palette.terracotta)
    plant.turned((0, 0, 0.3), [(0.175, 0.0), (0.1, 0.02), (0, 0.025)], palette.soil)
    stems = (((0.0, 0.0), (0.04, -0.03), 1.5), ((0.05, -0.02), (0.2, -0.14), 1.2), ((-0.03, -0.04), (-0.1, -0.2), 1.05))
    mesh = leaf_mesh()
    for stem, (foot, head, height) in enumerate(stems):
        plant.beam((*foot, 0.3), (*head, height), (0.013, 0.006), palette.bark)
        for index in range(13):
            share = 0.25 + 0.75 * index / 12
            turn = index * GOLDEN_ANGLE + stem
            x = foot[0] + (head[0] - foot[0]) * share + 0.02 * cos(turn)
            y = foot[1] + (head[1] - foot[1]) * share + 0.02 * sin(turn)
            z = 0.3 + (height - 0.3) * share
            droop_deg = -38 + 34 * (1 - share) + rng.uniform(-8, 8)
            leaf = plant.add(mesh, (x, y, z), palette.leaf, (0, droop_deg, 0))
            leaf.rotation_euler = (0, radians(droop_deg), turn)
            leaf.scale = (rng.uniform(0.8, 1.15),) * 3


def leaf_mesh(length_m: float = 0.25, width_m: float = 0.12):
    """A leaf along +x that arches down towards its tip."""
    along, across = np.mgrid[0:1:14j, -1:1:7j]
    outline = np.sin(np.pi * np.clip(along, 0, 1) ** 0.85) * 0.98 + 0.02
    x = along * length_m
    y = across * outline * width_m / 2
    z = 0.05 * along - 0.09 * along**2 + 0.018 * np.abs(across) * outline
    return grid_mesh("leaf", np.stack([x, y, z], axis=-1))


def add_sideboard_things(palette: Palette) -> None:
    """A table lamp, standing books, a jar and a dish."""
    top = Piece("sideboard things", (EAST_M - 0.24, 0.55, 0.7), -90.0)
    foot = [(0, 0), (0.07, 0), (0.1, 0.05), (0.085, 0.14), (0.03, 0.2), (0.012, 0.22), (0.012, 0.3), (0, 0.3)]
    top.turned((-0.5, 0, 0), foot, palette.stoneware)
    top.turned((-0.5, 0, 0.25), [(0.15, 0.0), (0.1, 0.2)], palette.shade, sides=48)
    jar = [(0, 0), (0.06, 0), (0.09, 0.1), (0.085, 0.2), (0.05, 0.27), (0.055, 0.3), (0.04, 0.29)]
    top.turned((0.55, 0.02, 0), jar, palette.terracotta)
    dish = [(0, 0), (0.05, 0), (0.12, 0.035), (0.13, 0.05), (0.115, 0.045), (0, 0.012)]
    top.turned((0.26, -0.05, 0), dish, palette.blue_glaze)
    x = -0.22
    for thick, tall in ((0.04, 0.24), (0.03, 0.21), (0.05, 0.26), (0.035, 0.2), (0.028, 0.23)):
        top.box((x + thick / 2, 0.03, tall / 2), (thick * 0.94, 0.17, tall), palette.books, bevel=0.003)
        x += thick


def add_basket(palette: Palette) -> None:
    """A wicker basket with blankets south of the sideboard."""
    basket = Piece("basket", (2.2, -0.62))
    profile = [(0, 0), (0.17, 0), (0.21, 0.15), (0.2, 0.32), (0.185, 0.32), (0.19, 0.15), (0.15, 0.03), (0, 0.02)]
    basket.turned((0, 0, 0), profile, palette.basket, sides=48)
    basket.cushion(
        (0.02, 0.01, 0.27), (0.26, 0.24, 0.16), palette.cream_cloth, radius=0.07, crown=0.02, tilt_deg=(8, 6, 20)
    )
