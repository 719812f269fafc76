"""Each kind of furniture as meshes, within its footprint. Needs pip's ``bpy``.

A builder is given the piece, whose frame stands on the floor in the footprint's middle (-y is the front), its size
(width, depth, height in metres), the room's finishes, and what draws the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import cos, radians, sin
from typing import Any

import numpy as np

from demo.living_room.build import Piece
from demo.living_room.decoration import GOLDEN_ANGLE, leaf_mesh

from .finishes import Finishes

Size = Sequence[float]
Builder = Callable[[Piece, Size, Finishes, np.random.Generator], None]


def _one_of(choices: Sequence[Any], rng: np.random.Generator) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _sofa(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    fabric, (_, legs) = _one_of(finishes.cloth, rng), _one_of(finishes.wood, rng)
    seats = 2 if w < 1.9 else 3
    arm = 0.16
    piece.box((0, 0.01, 0.24), (w - 0.06, d - 0.08, 0.18), fabric, bevel=0.03)
    piece.cushion((0, d / 2 - 0.11, h * 0.58), (w - 0.04, 0.18, h * 0.72), fabric, radius=0.06, crown=0.0)
    for side in (-1, 1):
        piece.cushion((side * (w - arm) / 2, -0.01, 0.38), (arm, d - 0.04, 0.42), fabric, radius=0.06, crown=0.0)
        for y in (-d / 2 + 0.08, d / 2 - 0.08):
            piece.beam((side * (w / 2 - 0.1), y, 0.16), (side * (w / 2 - 0.08), y, 0.0), (0.028, 0.018), legs)
    wide = (w - 2 * arm) / seats
    for index in range(seats):
        x = (index - (seats - 1) / 2) * wide
        piece.cushion((x, -0.1, 0.41), (wide - 0.01, d - 0.3, 0.15), fabric, radius=0.05, crown=0.02)
        if rng.random() < 0.7:
            piece.pillow((x, 0.06, 0.64), (0.4, 0.4, 0.14), _one_of(finishes.cloth, rng), (68, 0, rng.uniform(-12, 12)))


def _bed(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    piece.box((0, 0, 0.22), (w - 0.02, d - 0.02, 0.16), along, bevel=0.01)
    piece.box((0, d / 2 - 0.03, h / 2), (w, 0.05, h), upright, bevel=0.012)
    for x in (-1, 1):
        for y in (-1, 1):
            piece.beam(
                (x * (w / 2 - 0.08), y * (d / 2 - 0.08), 0.15),
                (x * (w / 2 - 0.08), y * (d / 2 - 0.08), 0.0),
                (0.03, 0.02),
                upright,
            )
    piece.cushion((0, -0.03, 0.4), (w - 0.08, d - 0.16, 0.2), finishes.paper, radius=0.06, crown=0.0)
    piece.cushion(
        (0, -d * 0.17, 0.47), (w - 0.05, d * 0.6, 0.12), _one_of(finishes.cloth, rng), radius=0.05, crown=0.02
    )
    for share in (-0.25, 0.25) if w > 1.3 else (0.0,):
        piece.pillow(
            (share * w, d / 2 - 0.34, 0.57),
            (0.55 if w > 1.3 else 0.6, 0.4, 0.16),
            _one_of(finishes.cloth, rng),
            (14, 0, 0),
        )


def _wardrobe(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    _, upright = _one_of(finishes.wood, rng)
    piece.box((0, 0.015, h / 2), (w, d - 0.03, h), upright, bevel=0.006)
    doors = max(2, round(w / 0.5))
    for index in range(doors):
        x = (index - (doors - 1) / 2) * w / doors
        piece.box((x, -d / 2 + 0.018, h / 2 + 0.03), (w / doors - 0.01, 0.02, h - 0.12), upright, bevel=0.005)
        x += (0.5 - index % 2) * (w / doors - 0.1)
        piece.box((x, -d / 2 + 0.005, h / 2), (0.016, 0.01, 0.18), finishes.metal, bevel=0.003)


def _shelf(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    boards = np.linspace(0.06, h - 0.0125, max(3, round(h / 0.36) + 1))
    for z in boards:
        piece.box((0, 0, z), (w - 0.01, d, 0.025), along, bevel=0.003)
    for side in (-1, 1):
        piece.box((side * (w / 2 - 0.014), 0, h / 2), (0.028, d, h), upright, bevel=0.003)
    if rng.random() < 0.7:
        piece.box((0, d / 2 - 0.006, h / 2), (w, 0.01, h), upright, bevel=0)
    for low, high in pairwise(boards):
        _row(piece, low + 0.0125, high - low - 0.04, w - 0.07, d, finishes, rng)


def _row(
    piece: Piece, z: float, room_m: float, w: float, d: float, finishes: Finishes, rng: np.random.Generator
) -> None:
    """Books, gaps and small things of one shelf."""
    x = -w / 2
    while x < w / 2 - 0.2:
        what = rng.random()
        if what < 0.6:
            for _ in range(int(rng.integers(3, 8))):
                thick = rng.uniform(0.025, 0.055)
                if x + thick > w / 2:
                    break
                tall, deep = rng.uniform(0.6, 0.95) * room_m, rng.uniform(0.6, 0.85) * d
                piece.box((x + thick / 2, 0.0, z + tall / 2), (thick * 0.93, deep, tall), finishes.books, bevel=0)
                x += thick
        elif what < 0.8:
            radius = min(0.09, d / 2 - 0.03)
            _vessel(piece, (x + radius, 0.0, z), radius, room_m * 0.7, finishes, rng)
            x += 2 * radius
        x += rng.uniform(0.02, 0.16)


def _cabinet(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    low = 0.12
    piece.box((0, 0.012, (h + low) / 2), (w, d - 0.025, h - low), along, bevel=0.006)
    for x in (-1, 1):
        for y in (-1, 1):
            piece.beam(
                (x * (w / 2 - 0.06), y * (d / 2 - 0.06), low),
                (x * (w / 2 - 0.05), y * (d / 2 - 0.05), 0.0),
                (0.024, 0.016),
                upright,
            )
    doors = max(2, round(w / 0.45))
    for index in range(doors):
        middle = (index - (doors - 1) / 2) * w / doors
        rows = 3 if rng.random() < 0.4 else 1
        tall = (h - low - 0.03) / rows
        for row in range(rows):
            z = low + 0.015 + (row + 0.5) * tall
            piece.box((middle, -d / 2 + 0.014, z), (w / doors - 0.012, 0.016, tall - 0.012), upright, bevel=0.004)
            piece.box((middle, -d / 2 + 0.004, z), (0.1, 0.007, 0.014), finishes.metal, bevel=0)


def _tv_board(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    _cabinet(piece, (w, d, 0.42), finishes, rng)
    wide = min(w - 0.1, 1.3)
    piece.box((0, 0.05, (h + 0.5) / 2), (wide, 0.03, h - 0.5), finishes.black, bevel=0.006)
    piece.box((0, 0.05, 0.46), (0.3, 0.14, 0.085), finishes.black, bevel=0.006)


def _desk(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    piece.box((0, 0, h - 0.015), (w, d, 0.03), along, bevel=0.005)
    side = 1 if rng.random() < 0.5 else -1
    piece.box((side * (w / 2 - 0.21), 0.02, (h - 0.03) / 2), (0.38, d - 0.08, h - 0.03), upright, bevel=0.006)
    for row in range(3):
        piece.box(
            (side * (w / 2 - 0.21), -d / 2 + 0.05, 0.14 + row * (h - 0.12) / 3),
            (0.34, 0.02, (h - 0.16) / 3),
            along,
            bevel=0.004,
        )
    for y in (-1, 1):
        x = -side * (w / 2 - 0.05)
        piece.beam((x, y * (d / 2 - 0.06), h - 0.03), (x, y * (d / 2 - 0.05), 0.0), (0.024, 0.02), finishes.metal)


def _nightstand(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    _, upright = _one_of(finishes.wood, rng)
    piece.box((0, 0.01, h / 2), (w, d - 0.02, h), upright, bevel=0.006)
    for z in (h * 0.3, h * 0.7):
        piece.box((0, -d / 2 + 0.014, z), (w - 0.04, 0.016, h * 0.34), upright, bevel=0.004)
        piece.box((0, -d / 2 + 0.004, z), (0.08, 0.007, 0.014), finishes.metal, bevel=0)


def _table(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    shape = rng.random()
    if shape < 0.3:
        disc = [(0, 0), (0.98, 0), (1.0, 0.012), (0.98, 0.03), (0, 0.03)]
        top = piece.turned((0, 0, h - 0.03), disc, along, sides=48)
        top.scale = (w / 2, d / 2, 1.0)
        foot = 0.32 * min(w, d)
        piece.turned((0, 0, 0), [(0, 0), (foot, 0), (foot, 0.02), (0.06, 0.07), (0.045, h - 0.03)], upright)
        return
    piece.box((0, 0, h - 0.018), (w, d, 0.036), along, bevel=0.008)
    if shape < 0.6:
        for x in (-1, 1):
            piece.box((x * (w / 2 - 0.12), 0, (h - 0.036) / 2), (0.05, d - 0.14, h - 0.036), upright, bevel=0.006)
        return
    for x in (-1, 1):
        for y in (-1, 1):
            foot_x, foot_y = x * (w / 2 - 0.05), y * (d / 2 - 0.05)
            piece.beam((foot_x * 0.93, foot_y * 0.93, h - 0.036), (foot_x, foot_y, 0.0), (0.032, 0.02), upright)


def _armchair(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    fabric, (along, upright) = _one_of(finishes.cloth, rng), _one_of(finishes.wood, rng)
    soft = rng.random() < 0.5
    for side in (-1, 1):
        x = side * (w / 2 - 0.04)
        if soft:
            piece.cushion((side * (w / 2 - 0.08), -0.02, 0.34), (0.15, d - 0.08, 0.46), fabric, radius=0.06, crown=0.0)
        else:
            piece.box((x, -0.03, 0.57), (0.06, d - 0.1, 0.026), along, bevel=0.008)
        for y in (-d / 2 + 0.06, d / 2 - 0.06):
            piece.beam((x, y, 0.0), (x, y, 0.15 if soft else 0.56), (0.017, 0.021), upright)
    piece.cushion((0, -0.05, 0.36), (w - 0.24, d - 0.2, 0.16), fabric, radius=0.05, crown=0.02)
    piece.cushion((0, d / 2 - 0.14, (h + 0.36) / 2), (w - 0.24, 0.15, h - 0.38), fabric, radius=0.055, crown=0.02)
    piece.box((0, 0, 0.24), (w - 0.14, d - 0.14, 0.06), along, bevel=0.006)


def _chair(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    along, upright = _one_of(finishes.wood, rng)
    for x in (-1, 1):
        piece.beam(
            (x * (w / 2 - 0.03), -d / 2 + 0.03, 0.0), (x * (w / 2 - 0.03), -d / 2 + 0.03, 0.44), (0.016, 0.02), upright
        )
        piece.beam(
            (x * (w / 2 - 0.03), d / 2 - 0.03, 0.0), (x * (w / 2 - 0.03), d / 2 - 0.03, h), (0.018, 0.016), upright
        )
    piece.box((0, 0, 0.45), (w - 0.01, d - 0.01, 0.03), along, bevel=0.008)
    if rng.random() < 0.5:
        piece.cushion(
            (0, -0.01, 0.485), (w - 0.06, d - 0.08, 0.05), _one_of(finishes.cloth, rng), radius=0.02, crown=0.01
        )
    for z in np.linspace(0.6, h - 0.05, int(rng.integers(2, 5))):
        piece.box((0, d / 2 - 0.03, z), (w - 0.06, 0.018, 0.05), along, bevel=0.006)


def _floor_lamp(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, _, h = size
    piece.turned((0, 0, 0), [(0, 0), (0.14, 0), (0.14, 0.018), (0.03, 0.03), (0, 0.03)], finishes.metal)
    piece.beam((0, 0, 0.02), (0, 0, h - 0.2), (0.012, 0.012), finishes.metal)
    piece.turned((0, 0, h - 0.3), [(w / 2, 0.0), (w / 2 * rng.uniform(0.5, 1.0), 0.3)], finishes.shade, sides=40)


def _plant(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, _, h = size
    pot = [(0, 0), (0.14, 0), (0.18, 0.28), (0.19, 0.3), (0.17, 0.3), (0.165, 0.27), (0, 0.27)]
    piece.turned((0, 0, 0), pot, _one_of(finishes.glaze, rng))
    piece.turned((0, 0, 0.26), [(0.165, 0.0), (0.1, 0.02), (0, 0.025)], finishes.soil)
    mesh = leaf_mesh()
    reach = w / 2 - 0.27
    for stem in range(3):
        foot = np.array([0.05 * cos(2.1 * stem), 0.05 * sin(2.1 * stem)])
        head = foot + rng.uniform(-0.5, 0.5, 2) * max(reach, 0.02)
        tall = (h - 0.08) * (1.0 - 0.13 * stem)
        piece.beam((*foot, 0.27), (*head, tall), (0.012, 0.006), finishes.bark)
        for index in range(11):
            share, turn = 0.25 + 0.75 * index / 10, index * GOLDEN_ANGLE + stem
            x, y = foot + (head - foot) * share
            leaf = piece.add(mesh, (x, y, 0.27 + (tall - 0.27) * share), finishes.leaf)
            leaf.rotation_euler = (0, radians(-36 + 34 * (1 - share) + rng.uniform(-8, 8)), turn)
            leaf.scale = (rng.uniform(0.6, 0.95),) * 3


def _pouf(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, _, h = size
    profile = [(0, 0), (0.7, 0.0), (0.9, 0.14), (1.0, 0.4), (0.95, 0.73), (0.7, 0.94), (0.28, 0.99), (0, 1.0)]
    piece.turned((0, 0, 0), [(r * w / 2, z * h) for r, z in profile], _one_of(finishes.cloth, rng), sides=40)


def _boxes(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    z = 0.0
    for tall in rng.dirichlet([4.0] * int(rng.integers(1, 4))) * h:
        share = rng.uniform(0.75, 0.95)
        material = finishes.cardboard if rng.random() < 0.6 else _one_of(finishes.glaze, rng)
        room = ((1 - share) * w * 0.4, (1 - share) * d * 0.4)
        at = (rng.uniform(-1, 1) * room[0], rng.uniform(-1, 1) * room[1], z + tall / 2)
        piece.box(at, (w * share, d * share, tall * 0.995), material, bevel=0.004)
        z += tall


def _rug(piece: Piece, size: Size, finishes: Finishes, rng: np.random.Generator) -> None:
    w, d, h = size
    piece.box((0, 0, h / 2 - 0.001), (w, d, h - 0.002), finishes.cardboard, bevel=0)
    piece.panel((0, 0, h), (w - 0.04, d - 0.04), finishes.rug)


def _vessel(
    piece: Piece, at: Sequence[float], radius: float, tall: float, finishes: Finishes, rng: np.random.Generator
) -> None:
    """A turned vase, bowl or jar."""
    shapes = (
        [(0, 0), (0.5, 0), (0.9, 0.3), (0.8, 0.65), (0.4, 0.85), (0.5, 1.0), (0.35, 0.97)],
        [(0, 0), (0.45, 0), (0.95, 0.7), (1.0, 1.0), (0.9, 1.0), (0.4, 0.25), (0, 0.2)],
        [(0, 0), (0.8, 0), (0.85, 0.9), (0.75, 0.9), (0.75, 0.98), (0.2, 1.0), (0, 1.0)],
    )
    profile = [(r * radius, z * tall) for r, z in _one_of(shapes, rng)]
    piece.turned(at, profile, _one_of(finishes.glaze, rng), sides=28)


def add_clutter(piece: Piece, size: Size, count: int, finishes: Finishes, rng: np.random.Generator) -> None:
    """Small things side by side on a top, each in its own part of the width."""
    w, d, h = size[0] * 0.8, size[1] * 0.62, size[2] + 0.001
    count = max(1, min(count, int(w / 0.15)))
    for index in range(count):
        room = w / count
        x, y = (index - (count - 1) / 2) * room, rng.uniform(-0.2, 0.2) * d
        radius = min(0.45 * room, 0.28 * d, 0.12)
        what = rng.random()
        if what < 0.4:
            _vessel(piece, (x, y, h), radius, rng.uniform(0.8, 2.6) * radius, finishes, rng)
        elif what < 0.75:
            z = h
            for _ in range(int(rng.integers(1, 4))):
                thick = rng.uniform(0.018, 0.04)
                flat = (radius * 1.2, radius * 1.5, thick)
                piece.box(
                    (x, y, z + thick / 2), flat, finishes.books, bevel=0.002, tilt_deg=(0, 0, rng.uniform(-14, 14))
                )
                z += thick + 0.0005
        elif what < 0.88:
            piece.turned(
                (x, y, h), [(0, 0), (0.6 * radius, 0), (0.2 * radius, 0.05), (0.012, 0.26), (0, 0.26)], finishes.metal
            )
            piece.turned((x, y, h + 0.22), [(radius, 0.0), (0.7 * radius, 0.16)], finishes.shade, sides=32)
        else:
            tall = rng.uniform(0.06, 0.2)
            piece.box((x, y, h + tall / 2), (radius * 1.3, radius * 1.2, tall), finishes.cardboard, bevel=0.003)


BUILDERS: dict[str, Builder] = {
    "sofa": _sofa,
    "bed": _bed,
    "wardrobe": _wardrobe,
    "shelf": _shelf,
    "cabinet": _cabinet,
    "tv_board": _tv_board,
    "desk": _desk,
    "nightstand": _nightstand,
    "dining_table": _table,
    "low_table": _table,
    "armchair": _armchair,
    "chair": _chair,
    "floor_lamp": _floor_lamp,
    "plant": _plant,
    "pouf": _pouf,
    "boxes": _boxes,
    "rug": _rug,
}
"""Kind -> what builds it."""
