"""The shell of the room: floor, walls with two windows, ceiling, skirting and curtains."""

from __future__ import annotations

import numpy as np

from .build import Piece, grid_mesh
from .materials import Palette

WIDTH_M, DEPTH_M, HEIGHT_M = 5.0, 4.4, 2.6
"""x from west to east, y from south to north, z up; the floor's middle is the origin."""

EAST_M, NORTH_M = WIDTH_M / 2, DEPTH_M / 2
WALL_M = 0.14


def add_shell(palette: Palette) -> None:
    """Floor, ceiling and the four walls."""
    shell = Piece("shell")
    shell.box((0, 0, -0.05), (WIDTH_M, DEPTH_M, 0.1), palette.floor, bevel=0)
    shell.box((0, 0, HEIGHT_M + 0.05), (WIDTH_M + 0.3, DEPTH_M + 0.3, 0.1), palette.ceiling, bevel=0)
    shell.box((0, NORTH_M + WALL_M / 2, HEIGHT_M / 2), (WIDTH_M, WALL_M, HEIGHT_M), palette.accent_wall, bevel=0)
    shell.box((EAST_M + WALL_M / 2, 0, HEIGHT_M / 2), (WALL_M, DEPTH_M + 0.3, HEIGHT_M), palette.wall, bevel=0)
    wall_with_window("south wall", (0, -NORTH_M, 0), 0.0, WIDTH_M, (-1.5, 1.1, 0.75, 2.25), palette)
    wall_with_window("west wall", (-EAST_M, 0, 0), -90.0, DEPTH_M, (-0.95, 0.55, 0.85, 2.2), palette)
    for centre, size in (
        ((0, NORTH_M - 0.009, 0.05), (WIDTH_M, 0.018, 0.1)),
        ((0, -NORTH_M + 0.009, 0.05), (WIDTH_M, 0.018, 0.1)),
        ((EAST_M - 0.009, 0, 0.05), (0.018, DEPTH_M, 0.1)),
        ((-EAST_M + 0.009, 0, 0.05), (0.018, DEPTH_M, 0.1)),
    ):
        shell.box(centre, size, palette.white_paint, bevel=0.004)


def wall_with_window(
    name: str,
    at: tuple[float, float, float],
    turn_deg: float,
    length_m: float,
    opening: tuple[float, float, float, float],
    palette: Palette,
    height_m: float = HEIGHT_M,
) -> None:
    """A wall along the piece's x whose room side is +y, with a framed window in it.

    ``opening`` is left, right, sill and head of the window, metres.
    """
    left, right, sill, head = opening
    wall = Piece(name, at, turn_deg)
    y = -WALL_M / 2
    wall.box((0, y, sill / 2), (length_m, WALL_M, sill), palette.wall, bevel=0)
    wall.box((0, y, (head + height_m) / 2), (length_m, WALL_M, height_m - head), palette.wall, bevel=0)
    for start, end in ((-length_m / 2, left), (right, length_m / 2)):
        size = (end - start, WALL_M, head - sill)
        wall.box(((start + end) / 2, y, (sill + head) / 2), size, palette.wall, bevel=0)
    middle_x, middle_z = (left + right) / 2, (sill + head) / 2
    frame, depth = 0.06, 0.05
    for z in (sill + frame / 2, head - frame / 2, sill + (head - sill) * 0.66):
        wall.box((middle_x, y, z), (right - left, depth, frame), palette.white_paint)
    for x in (left + frame / 2, middle_x, right - frame / 2):
        wall.box((x, y, middle_z), (frame, depth, head - sill), palette.white_paint)
    wall.box((middle_x, 0.04, sill - 0.015), (right - left + 0.12, 0.2, 0.03), palette.white_paint)


def add_west_curtain(palette: Palette) -> None:
    """A pleated sheer curtain that covers the west window and glows in the daylight."""
    curtain = Piece("curtain", (-EAST_M + 0.11, 0.2))
    curtain.add(_pleats(width_m=1.95, height_m=2.33, pleat_m=0.13, depth_m=0.028), (0, 0, 0.03), palette.curtain)
    curtain.beam((0, -1.08, 2.4), (0, 1.08, 2.4), (0.014, 0.014), palette.brass)
    for end in (-1.1, 1.1):
        curtain.turned((0, end, 2.37), [(0, 0), (0.028, 0.01), (0.034, 0.03), (0.02, 0.055), (0, 0.06)], palette.brass)


def _pleats(width_m: float, height_m: float, pleat_m: float, depth_m: float):
    """A hanging cloth along y whose folds open towards the floor."""
    z, y = np.mgrid[0:height_m:24j, -width_m / 2 : width_m / 2 : 260j]
    opening = 0.65 + 0.35 * (1 - z / height_m)
    sway = 0.3 * np.sin(y * 3.1) + 0.25 * np.sin(y * 7.7 + z * 0.6)
    x = depth_m * opening * np.sin(2 * np.pi * y / pleat_m + sway)
    return grid_mesh("pleats", np.stack([x, y, z], axis=-1))
