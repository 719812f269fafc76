"""A plan as meshes, materials and lights in Blender. Needs pip's ``bpy``."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, degrees
from types import SimpleNamespace

import bpy
import numpy as np

from demo.living_room.architecture import WALL_M, wall_with_window
from demo.living_room.build import Piece, new_mesh
from demo.living_room.decoration import framed
from demo.living_room.lights import SKYLIGHT, add_area, add_bulb, add_sky, add_sun

from .finishes import Finishes, art, make_finishes
from .furniture import KINDS
from .layout import Layout, Opening, Wall
from .pieces import BUILDERS, add_clutter
from .plan import Placed, RoomPlan

_SKIRTING_M = (0.018, 0.1)


def build(plan: RoomPlan) -> None:
    """The room of a plan, from an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rng = np.random.default_rng([plan.seed, 1])
    finishes = make_finishes(plan.style, rng)
    _add_shell(plan, finishes)
    for index, placed in enumerate(plan.placed):
        _add_piece(f"{placed.kind} {index}", placed, plan, finishes)
    _add_pictures(plan, finishes, rng)
    _add_lights(plan, finishes)


def _add_shell(plan: RoomPlan, finishes: Finishes) -> None:
    layout = plan.layout
    corners = layout.corners()
    for name, z, order, material in (
        ("floor", 0.0, 1, finishes.floor),
        ("ceiling", layout.height_m, -1, finishes.ceiling),
    ):
        outline = [(x, y, z) for x, y in corners[::order]]
        Piece(name).add(new_mesh(name, outline, [tuple(range(len(outline)))]), (0, 0, 0), material)
    for index, wall in enumerate(layout.walls):
        _add_wall(index, wall, layout, finishes.accent if index == plan.accent else finishes.wall, finishes)


def _frame(wall: Wall, along_m: float) -> tuple[tuple[float, float], float]:
    """Where a piece stands whose x runs along the wall and whose +y looks into the room."""
    x, y = wall.start + wall.along * along_m
    return (float(x), float(y)), degrees(atan2(-wall.inwards[0], wall.inwards[1]))


def _add_wall(index: int, wall: Wall, layout: Layout, material: object, finishes: Finishes) -> None:
    windows = [one for one in wall.openings if one.kind == "window"]
    between = [(a.along_m + a.width_m / 2 + b.along_m - b.width_m / 2) / 2 for a, b in pairwise(windows)]
    # Beyond convex corners a wall goes on outside, so that no light comes in where two meet. At a corner
    # that juts into the room the end of the wall before it is the first part of this one's face.
    first, last = -WALL_M if wall.convex[0] else WALL_M, WALL_M if wall.convex[1] else 0.0
    cuts = [first, *between, wall.length_m + last]
    for part, (low, high) in enumerate(pairwise(cuts)):
        name, middle = f"wall {index}.{part}", (low + high) / 2
        place, turn = _frame(wall, middle)
        if not windows:
            piece = Piece(name, place, turn)
            size = (high - low, WALL_M, layout.height_m)
            piece.box((0, -WALL_M / 2, layout.height_m / 2), size, material, bevel=0)
            continue
        one = windows[part]
        opening = (
            one.along_m - one.width_m / 2 - middle,
            one.along_m + one.width_m / 2 - middle,
            one.sill_m,
            one.head_m,
        )
        looks = SimpleNamespace(wall=material, white_paint=finishes.white_paint)
        wall_with_window(name, (*place, 0.0), turn, high - low, opening, looks, layout.height_m)
    place, turn = _frame(wall, wall.length_m / 2)
    skirting = Piece(f"skirting {index}", place, turn)
    deep, tall = _SKIRTING_M
    skirting.box((0, deep / 2, tall / 2), (wall.length_m, deep, tall), finishes.white_paint, bevel=0)
    for one in wall.openings:
        if one.kind == "door":
            _add_door(Piece(f"door {index}", *_frame(wall, one.along_m)), one, finishes)


def _add_door(door: Piece, opening: Opening, finishes: Finishes) -> None:
    """A closed door in its casing, on the wall's face."""
    w, h = opening.width_m, opening.head_m
    upright = finishes.wood[0][1]
    door.box((0, 0.02, h / 2), (w - 0.1, 0.04, h), upright, bevel=0.004)
    for z in (h * 0.28, h * 0.72):
        door.box((0, 0.042, z), (w - 0.34, 0.012, h * 0.32), upright, bevel=0.004)
    for side in (-1, 1):
        door.box((side * (w / 2 - 0.025), 0.025, h / 2), (0.05, 0.05, h), finishes.white_paint, bevel=0.003)
    door.box((0, 0.025, h + 0.025), (w, 0.05, 0.05), finishes.white_paint, bevel=0.003)
    door.box((w / 2 - 0.14, 0.06, h * 0.5), (0.12, 0.02, 0.02), finishes.metal, bevel=0.004)


def _add_piece(name: str, placed: Placed, plan: RoomPlan, finishes: Finishes) -> None:
    rng = np.random.default_rng(placed.seed)
    piece = Piece(name, placed.at, placed.turn_deg)
    size = tuple(map(float, placed.size))
    BUILDERS[placed.kind](piece, size, finishes, rng)
    if KINDS[placed.kind].top:
        low, high = plan.style.clutter
        add_clutter(piece, size, int(rng.integers(low, high + 1)), finishes, rng)


def _add_pictures(plan: RoomPlan, finishes: Finishes, rng: np.random.Generator) -> None:
    for index, one in enumerate(plan.pictures):
        wall = plan.layout.walls[one.wall]
        (x, y), turn = _frame(wall, one.along_m)
        piece = Piece(f"picture {index}", (x, y), turn + 180.0)  # a picture looks to -y
        framed(piece, art(f"art {index}", rng), one.size, one.above_m, finishes.wood[-1][0], finishes.paper)


def _add_lights(plan: RoomPlan, finishes: Finishes) -> None:
    layout = plan.layout
    for wall_index, wall in enumerate(layout.walls):
        for one in wall.openings:
            if one.kind == "window":
                x, y = wall.start + wall.along * one.along_m - wall.inwards * 0.3
                size = (one.width_m, one.head_m - one.sill_m)
                place = (x, y, (one.sill_m + one.head_m) / 2)
                name = f"sky {wall_index} {one.along_m:.3f}"
                add_area(name, place, (*wall.inwards, -0.1), size, 22.0 * size[0] * size[1], SKYLIGHT)
    for index, (x, y) in enumerate(plan.lamps):
        lamp = Piece(f"lamp {index}", (x, y, layout.height_m))
        lamp.turned((0, 0, -0.06), [(0, 0), (0.13, 0.0), (0.15, 0.03), (0.15, 0.06), (0, 0.06)], finishes.shade)
        place = (x, y, layout.height_m - 0.08)
        add_area(f"lamp light {index}", place, (0, 0, -1), (0.5, 0.5), plan.style.lamp_w, (1.0, 0.92, 0.82))
    for index, placed in enumerate(plan.placed):
        if placed.kind == "floor_lamp":
            add_bulb(f"bulb {index}", (*placed.at, placed.size[2] - 0.15), 10.0)
    if plan.style.sun:
        add_sun(plan.style.sun, 20.0 + 30.0 * (plan.seed % 5), 35.0)
    add_sky(0.8)
