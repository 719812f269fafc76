"""The furniture: sofa, low table, lounge chairs, bookshelf, sideboard, rug and pouf."""

from __future__ import annotations

import numpy as np

from .architecture import EAST_M, NORTH_M
from .build import Piece, grid_mesh
from .materials import Palette


def add_furniture(palette: Palette, rng: np.random.Generator) -> None:
    """Everything a robot could bump into, less the decoration."""
    add_rug(palette)
    add_sofa(palette)
    add_low_table(palette, rng)
    add_lounge_chair("mustard chair", (-1.72, 0.62), 62.0, palette.mustard_cloth, palette)
    add_lounge_chair("navy chair", (1.18, 0.02), -68.0, palette.navy_cloth, palette)
    add_bookshelf(palette, rng)
    add_sideboard(palette)
    add_pouf(palette)


def add_rug(palette: Palette) -> None:
    """A kilim under the seating group."""
    rug = Piece("rug", (-0.3, 0.22))
    rug.box((0, 0, 0.005), (2.72, 1.98, 0.01), palette.rug_edge, bevel=0.003)
    rug.panel((0, 0, 0.0108), (2.66, 1.94), palette.rug)


def add_sofa(palette: Palette) -> None:
    """A two-and-a-half seater against the north wall, its front facing south."""
    sofa = Piece("sofa", (-0.55, NORTH_M - 0.55))
    cloth = palette.rust_cloth
    sofa.cushion((0, 0.02, 0.24), (2.06, 0.88, 0.2), cloth, radius=0.04, crown=0.0)
    sofa.cushion((0, 0.4, 0.53), (2.06, 0.2, 0.56), cloth, radius=0.07, crown=0.015, tilt_deg=(-6, 0, 0))
    for side in (-1, 1):
        sofa.cushion((side * 0.96, 0.0, 0.4), (0.18, 0.92, 0.44), cloth, radius=0.07, crown=0.012)
        seat = (side * 0.435, -0.07, 0.405)
        sofa.cushion(seat, (0.86, 0.74, 0.16), cloth, radius=0.055, crown=0.03)
        sofa.cushion((side * 0.435, 0.24, 0.66), (0.84, 0.17, 0.42), cloth, 0.07, 0.035, tilt_deg=(-14, 0, 0))
        for y in (-0.36, 0.38):
            sofa.beam((side * 0.9, y, 0.16), (side * 0.94, y, 0.0), (0.028, 0.016), palette.walnut_upright)
    sofa.pillow((-0.68, 0.02, 0.66), (0.46, 0.46, 0.17), palette.cream_cloth, (68, 0, 16))
    sofa.pillow((-0.38, -0.01, 0.63), (0.38, 0.38, 0.15), palette.mustard_cloth, (64, 0, -10))
    sofa.pillow((0.7, 0.02, 0.65), (0.44, 0.44, 0.16), palette.navy_cloth, (66, 0, -14))
    _throw_blanket(sofa, palette)


def _throw_blanket(sofa: Piece, palette: Palette) -> None:
    """A woollen throw over the eastern arm, hanging down both of its sides."""
    arm_x, top_z, half_arm = 0.96, 0.64, 0.105
    along = np.linspace(-0.36, 0.62, 40)
    profile = []
    for s in along:
        if s < -half_arm:
            profile.append((arm_x - half_arm - 0.01, top_z + (s + half_arm)))
        elif s > half_arm:
            profile.append((arm_x + half_arm + 0.012, top_z - (s - half_arm)))
        else:
            profile.append((arm_x + s * 1.08, top_z + 0.012 * (1 - (s / half_arm) ** 2)))
    path = np.array(profile)
    y = np.linspace(-0.34, 0.12, 24)
    points = np.empty((len(y), len(path), 3))
    points[..., 0] = path[None, :, 0] + 0.006 * np.sin(y * 40)[:, None]
    points[..., 1] = y[:, None] + 0.02 * np.sin(along * 9)[None, :]
    points[..., 2] = path[None, :, 1]
    sofa.add(grid_mesh("throw", points), (0, 0, 0), palette.stripes)


def add_low_table(palette: Palette, rng: np.random.Generator) -> None:
    """A walnut table with a lower shelf, magazines, a bowl and a vase with twigs."""
    table = Piece("low table", (-0.5, 0.22), 4.0)
    table.box((0, 0, 0.415), (1.15, 0.58, 0.035), palette.walnut, bevel=0.012)
    table.box((0, 0, 0.17), (0.95, 0.42, 0.02), palette.walnut, bevel=0.006)
    for x in (-1, 1):
        for y in (-1, 1):
            table.beam((x * 0.47, y * 0.2, 0.4), (x * 0.53, y * 0.25, 0.0), (0.024, 0.014), palette.walnut_upright)
    top = 0.4325
    for index, turn in enumerate((6.0, -5.0, 14.0)):
        size = (0.25 - 0.02 * index, 0.19 - 0.012 * index, 0.028)
        _lying_book(table, (-0.32, 0.05, top + 0.014 + 0.03 * index), size, turn, palette)
    bowl = [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.07, 0.012),
        (0.13, 0.06),
        (0.145, 0.085),
        (0.135, 0.085),
        (0.06, 0.03),
        (0, 0.025),
    ]
    table.turned((0.08, -0.1, top), bowl, palette.blue_glaze)
    for x, y in ((0.05, -0.12), (0.12, -0.07), (0.07, -0.05), (0.11, -0.13)):
        orange = [(0, 0), (0.022, 0.006), (0.034, 0.028), (0.03, 0.048), (0.012, 0.062), (0, 0.064)]
        table.turned((x, y, top + 0.035), orange, palette.terracotta, sides=20)
    vase = [(0, 0), (0.05, 0), (0.075, 0.05), (0.07, 0.12), (0.035, 0.18), (0.032, 0.21), (0.042, 0.23), (0.03, 0.225)]
    table.turned((0.38, 0.1, top), vase, palette.stoneware)
    for _ in range(9):
        lean = rng.uniform(-0.16, 0.16, 2)
        length = rng.uniform(0.22, 0.38)
        start = (0.38, 0.1, top + 0.2)
        end = (0.38 + lean[0], 0.1 + lean[1], top + 0.2 + length)
        table.beam(start, end, (0.004, 0.0025), palette.bark)
        bud = [(0, 0), (0.016, 0.012), (0.018, 0.03), (0, 0.05)]
        table.turned(end, bud, palette.cream_cloth, sides=12)
    for index in range(4):
        _lying_book(table, (0.2, 0.0, 0.19 + 0.02 * index), (0.27, 0.2, 0.018), rng.uniform(-9, 9), palette)


def _lying_book(piece: Piece, centre, size, turn_deg: float, palette: Palette) -> None:
    piece.box(centre, size, palette.books, bevel=0.003, tilt_deg=(0, 0, turn_deg))


def add_lounge_chair(name: str, at: tuple[float, float], turn_deg: float, cloth, palette: Palette) -> None:
    """A low armchair: a wooden frame that carries a seat and a leaning back cushion."""
    chair = Piece(name, at, turn_deg)
    for side in (-1, 1):
        x = side * 0.31
        chair.beam((x, -0.3, 0.0), (x, -0.27, 0.55), (0.017, 0.021), palette.oak_upright)
        chair.beam((x, 0.38, 0.0), (x, 0.22, 0.56), (0.017, 0.021), palette.oak_upright)
        chair.beam((x * 0.9, 0.14, 0.27), (x * 0.9, 0.42, 0.86), (0.02, 0.016), palette.oak_upright)
        chair.box((x, -0.04, 0.565), (0.062, 0.62, 0.026), palette.oak, bevel=0.01, tilt_deg=(-2, 0, 0))
        chair.box((x * 0.92, -0.02, 0.27), (0.03, 0.62, 0.05), palette.oak, bevel=0.006, tilt_deg=(-7, 0, 0))
    for y, z in ((-0.27, 0.305), (0.24, 0.25), (0.405, 0.82)):
        chair.box((0, y, z), (0.58, 0.03, 0.05), palette.oak, bevel=0.006)
    chair.cushion((0, -0.04, 0.37), (0.56, 0.6, 0.13), cloth, radius=0.05, crown=0.025, tilt_deg=(-7, 0, 0))
    chair.cushion((0, 0.25, 0.66), (0.55, 0.13, 0.52), cloth, radius=0.055, crown=0.03, tilt_deg=(-23, 0, 0))


def add_bookshelf(palette: Palette, rng: np.random.Generator) -> None:
    """An open oak shelf at the north wall, filled with books, bowls and a trailing gap or two."""
    shelf = Piece("bookshelf", (1.62, NORTH_M - 0.19))
    width, depth, height = 1.1, 0.3, 1.86
    boards = np.linspace(0.09, height - 0.012, 6)
    for z in boards:
        shelf.box((0, 0, z), (width, depth, 0.025), palette.oak, bevel=0.003)
    for side in (-1, 1):
        shelf.box((side * width / 2, 0, height / 2), (0.028, depth, height), palette.oak_upright, bevel=0.003)
    shelf.box((0, depth / 2 - 0.006, height / 2), (width, 0.01, height), palette.oak_upright, bevel=0)
    for row, z in enumerate(boards[:-1]):
        room_m = boards[row + 1] - z - 0.03
        _row_of_books(shelf, z + 0.0125, room_m, width, row, palette, rng)


def _row_of_books(
    shelf: Piece, z: float, room_m: float, width: float, row: int, palette: Palette, rng: np.random.Generator
) -> None:
    """Upright books from the left; a pot or a lying stack stands in each row's gap."""
    gap_start = (0.18, -0.46, 0.02, -0.2, 0.2)[row]
    gap_end = gap_start + 0.26
    x = -width / 2 + 0.03
    while x < width / 2 - 0.06:
        if gap_start <= x < gap_end:
            x = gap_end
            continue
        thick = rng.uniform(0.022, 0.052)
        tall = rng.uniform(0.6, 0.93) * room_m
        deep = rng.uniform(0.16, 0.22)
        lean = rng.uniform(-1.2, 1.2)
        centre = (x + thick / 2, 0.12 - deep / 2, z + tall / 2)
        shelf.box(centre, (thick * 0.93, deep, tall), palette.books, bevel=0.003, tilt_deg=(0, lean, 0))
        x += thick
    middle = (gap_start + 0.14, -0.01, z)
    if row % 2:
        pot = [(0, 0), (0.055, 0), (0.08, 0.06), (0.07, 0.13), (0.045, 0.16), (0.05, 0.18), (0.035, 0.17)]
        shelf.turned(middle, pot, palette.blue_glaze if row == 1 else palette.terracotta)
        return
    for index in range(3):
        centre = (middle[0], middle[1], z + 0.018 + 0.034 * index)
        _lying_book(shelf, centre, (0.21 - 0.02 * index, 0.16, 0.032), rng.uniform(-8, 8), palette)


def add_sideboard(palette: Palette) -> None:
    """A low walnut cabinet with two doors and three drawers, at the east wall."""
    board = Piece("sideboard", (EAST_M - 0.24, 0.55), -90.0)
    board.box((0, 0, 0.44), (1.5, 0.42, 0.52), palette.walnut, bevel=0.008)
    for index in range(3):
        board.box((0, -0.212, 0.27 + 0.17 * index), (0.46, 0.016, 0.155), palette.oak, bevel=0.005)
        board.beam((0, -0.215, 0.27 + 0.17 * index), (0, -0.245, 0.27 + 0.17 * index), (0.012, 0.014), palette.brass)
    for side in (-1, 1):
        board.box((side * 0.49, -0.212, 0.44), (0.47, 0.016, 0.495), palette.walnut_upright, bevel=0.005)
        board.beam((side * 0.3, -0.215, 0.5), (side * 0.3, -0.245, 0.5), (0.012, 0.014), palette.brass)
        for y in (-0.15, 0.15):
            board.beam((side * 0.66, y, 0.19), (side * 0.7, y, 0.0), (0.024, 0.014), palette.walnut_upright)


def add_pouf(palette: Palette) -> None:
    """A round knitted seat beside the rug."""
    pouf = Piece("pouf", (1.15, 1.12))
    profile = [(0, 0), (0.2, 0.0), (0.26, 0.05), (0.285, 0.15), (0.27, 0.27), (0.2, 0.345), (0.08, 0.365), (0, 0.368)]
    pouf.turned((0, 0, 0), profile, palette.basket, sides=48)
