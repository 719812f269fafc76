"""A furnished room on paper: what stands where, drawn from a style by a seed. NumPy alone."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from math import atan2, cos, degrees, radians, sin

import numpy as np

from .furniture import KINDS, Kind
from .layout import Layout, Wall, draw_layout
from .style import Style

_WALL_GAP_M = 0.03
_GAP_M = 0.04
_TRIES = 80
_DOOR_FREE_M = 0.9
_SILL_M = 0.16
_PICTURE_M = ((0.35, 0.9), (0.35, 0.75))


@dataclass(frozen=True)
class Placed:
    """A piece of furniture: its footprint's middle ``at`` (2,), turned counter-clockwise; ``size`` (3,) metres.

    Its front is -y before it is turned. ``seed`` draws what is left open: books, leaves, small things.
    """

    kind: str
    at: np.ndarray
    turn_deg: float
    size: np.ndarray
    seed: int

    def footprint(self, grown_m: float = 0.0, front_m: float = 0.0) -> np.ndarray:
        """(4, 2) corners on the floor, grown on all sides and towards the front."""
        x, y = self.size[0] / 2 + grown_m, self.size[1] / 2 + grown_m
        local = np.array([(-x, -y - front_m), (x, -y - front_m), (x, y), (-x, y)])
        angle = radians(self.turn_deg)
        turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
        corners: np.ndarray = local @ turn.T + self.at
        return corners


@dataclass(frozen=True)
class Picture:
    """A framed picture: the wall's index, its middle along it and above the floor, width and height, metres."""

    wall: int
    along_m: float
    above_m: float
    size: tuple[float, float]


@dataclass(frozen=True)
class RoomPlan:
    """All that is drawn of one room; the same style and seed give the same."""

    style: Style
    seed: int
    layout: Layout
    accent: int
    """The wall that is told apart, by index."""
    placed: tuple[Placed, ...]
    pictures: tuple[Picture, ...]
    lamps: tuple[tuple[float, float], ...]
    """Places of the lamps at the ceiling."""
    eye_m: float

    def digest(self) -> str:
        """The SHA-256 of everything in it."""
        with np.printoptions(precision=17, floatmode="unique", legacy=False):
            return hashlib.sha256(repr(self).encode()).hexdigest()


@dataclass
class _Floor:
    """What is taken while pieces find their places: footprints, and what is kept free before them."""

    layout: Layout
    stands: list[np.ndarray] = field(default_factory=list)
    kept: list[np.ndarray] = field(default_factory=list)
    sills: list[tuple[float, np.ndarray]] = field(default_factory=list)
    """Height and outline of the boards of windows: what reaches above them stands elsewhere."""

    def has_room(self, piece: Placed, front_m: float, beside: bool = False) -> bool:
        """Whether the piece may stand there; ``beside`` what keeps its front free for this piece, a chair."""
        own = piece.footprint()
        if not self.layout.contains(_rim(piece.footprint(_WALL_GAP_M - 0.005))).all():
            return False
        tall = np.inf if KINDS[piece.kind].top else piece.size[2] + 0.05
        if any(tall > sill and overlap(own, board) for sill, board in self.sills):
            return False
        grown = piece.footprint(_GAP_M)
        if any(overlap(grown, other) for other in self.stands):
            return False
        if not beside and any(overlap(own, other) for other in self.kept):
            return False
        reach = piece.footprint(0.0, front_m)
        return not front_m or not any(overlap(reach, other) for other in self.stands)

    def take(self, piece: Placed, front_m: float, all_round: bool = False) -> None:
        self.stands.append(piece.footprint())
        if front_m:
            self.kept.append(piece.footprint(front_m) if all_round else piece.footprint(0.0, front_m))


def overlap(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two convex outlines (N, 2) have more than their rims in common (separating axes)."""
    for outline in (one, other):
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
        a, b = one @ normals.T, other @ normals.T
        if ((a.max(axis=0) <= b.min(axis=0) + 1e-9) | (b.max(axis=0) <= a.min(axis=0) + 1e-9)).any():
            return False
    return True


def _rim(outline: np.ndarray) -> np.ndarray:
    """Points along an outline, no farther than a tenth of a side apart."""
    share = np.linspace(0.0, 1.0, 11)[:, None, None]
    rim: np.ndarray = (1.0 - share) * outline + share * np.roll(outline, -1, axis=0)
    return rim.reshape(-1, 2)


def room_plan(style: Style, seed: int) -> RoomPlan:
    """The room of a seed, any whole number from 0."""
    rng = np.random.default_rng([seed, *style.name.encode()])
    layout = draw_layout(style, rng)
    floor = _Floor(layout)
    _keep_openings_free(floor)
    placed: list[Placed] = []
    for name in style.furniture:
        placed += _place(name, floor, rng)
    accent = int(rng.integers(len(layout.walls)))
    pictures = _pictures(style, layout, placed, rng)
    reach = layout.half * 0.5
    corners = [(x, y) for x in (-reach[0], reach[0]) for y in (-reach[1], reach[1])]
    lamps = tuple((float(x), float(y)) for x, y in corners if layout.contains(np.array([x, y])))
    return RoomPlan(style, seed, layout, accent, tuple(placed), pictures, lamps, float(rng.uniform(*style.eye_m)))


def _keep_openings_free(floor: _Floor) -> None:
    for wall in floor.layout.walls:
        for one in wall.openings:
            if one.kind == "door":
                floor.kept.append(_before(wall, one.along_m, one.width_m, _DOOR_FREE_M))
            else:
                floor.sills.append((one.sill_m, _before(wall, one.along_m, one.width_m + 0.2, _SILL_M)))


def _before(wall: Wall, along_m: float, width_m: float, deep_m: float) -> np.ndarray:
    """(4, 2): the floor before a part of a wall."""
    low = wall.start + wall.along * (along_m - width_m / 2)
    high = wall.start + wall.along * (along_m + width_m / 2)
    return np.array([low, high, high + wall.inwards * deep_m, low + wall.inwards * deep_m])


def _place(name: str, floor: _Floor, rng: np.random.Generator) -> list[Placed]:
    """The piece and its chairs, or nothing where no room is left."""
    kind = KINDS[name]
    size = _size(kind, floor.layout.height_m, rng)
    for _ in range(_TRIES):
        at, turn = _at_wall(floor.layout, size, rng) if kind.at_wall else _free(floor.layout, rng)
        piece = Placed(name, at, turn, size, int(rng.integers(1 << 31)))
        if not floor.has_room(piece, kind.front_m):
            continue
        floor.take(piece, kind.front_m, all_round=not kind.at_wall)
        return [piece, *_chairs(piece, kind, floor, rng)]
    return []


def _size(kind: Kind, ceiling_m: float, rng: np.random.Generator) -> np.ndarray:
    size = np.array([rng.uniform(*kind.width_m), rng.uniform(*kind.depth_m), rng.uniform(*kind.height_m)])
    if kind.square:
        size[1] = size[0]
    size[2] = min(size[2], ceiling_m - 0.2)
    return size.round(3)


def _at_wall(layout: Layout, size: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    lengths = np.array([wall.length_m for wall in layout.walls])
    wall = layout.walls[rng.choice(len(lengths), p=lengths / lengths.sum())]
    room = max(wall.length_m - size[0] - 2 * _WALL_GAP_M, 0.0)
    along = size[0] / 2 + _WALL_GAP_M + room * rng.random()
    at = wall.start + wall.along * along + wall.inwards * (size[1] / 2 + _WALL_GAP_M)
    outwards = -wall.inwards
    return at.round(4), round(degrees(atan2(-outwards[0], outwards[1])), 6)


def _free(layout: Layout, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    turn = 90.0 * int(rng.integers(4)) + float(rng.uniform(-12.0, 12.0)) * int(rng.integers(2))
    return (layout.half * rng.uniform(-0.95, 0.95, 2)).round(4), round(turn, 3)


def _chairs(table: Placed, kind: Kind, floor: _Floor, rng: np.random.Generator) -> list[Placed]:
    """Chairs at a table's long sides, then its ends, drawn up to it; at a desk one before its front."""
    found: list[Placed] = []
    if not kind.chairs:
        return found
    width, depth = table.size[0], table.size[1]
    seats = [(0.0, -1.0, 0.0)]
    if kind.chairs > 1:
        seats = [(x, side, 0.0) for side in (-1.0, 1.0) for x in ((-width / 4, width / 4) if width > 1.25 else (0.0,))]
        seats += [(side, 0.0, 1.0) for side in (-1.0, 1.0)]
    wanted = int(rng.integers(2, kind.chairs + 1)) if kind.chairs > 1 else 1
    size = _size(KINDS["chair"], 9.0, rng)
    angle = radians(table.turn_deg)
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    for x, y, end in seats[:wanted]:
        away = _GAP_M + 0.02 + 0.12 * rng.random() + size[1] / 2
        local = np.array([x * (width / 2 + away), 0.0]) if end else np.array([x, y * (depth / 2 + away)])
        # A chair's front, -y, looks at the table.
        facing = (90.0 * -x) if end else (180.0 if y < 0.0 else 0.0)
        chair = Placed(
            "chair", (turn @ local + table.at).round(4), table.turn_deg + facing, size, int(rng.integers(1 << 31))
        )
        if floor.has_room(chair, 0.0, beside=True):
            floor.take(chair, 0.0)
            found.append(chair)
    return found


def _pictures(style: Style, layout: Layout, placed: list[Placed], rng: np.random.Generator) -> tuple[Picture, ...]:
    """Pictures where neither an opening nor tall furniture is, and no other picture."""
    found: list[Picture] = []
    wanted = int(rng.integers(style.pictures[0], style.pictures[1] + 1))
    for _ in range(_TRIES):
        if len(found) == wanted:
            break
        index = int(rng.integers(len(layout.walls)))
        wall = layout.walls[index]
        width, height = (round(float(rng.uniform(*side)), 3) for side in _PICTURE_M)
        if wall.length_m < width + 0.5:
            continue
        along = float(rng.uniform(width / 2 + 0.2, wall.length_m - width / 2 - 0.2))
        one = Picture(index, round(along, 3), round(float(rng.uniform(1.55, 1.7)), 3), (width, height))
        first, last = along - width / 2 - 0.08, along + width / 2 + 0.08
        if not wall.free_of(first, last, ("door", "window")) or _behind_something(one, wall, placed):
            continue
        if all(
            other.wall != index or abs(other.along_m - along) > (other.size[0] + width) / 2 + 0.1 for other in found
        ):
            found.append(one)
    return tuple(found)


def _behind_something(picture: Picture, wall: Wall, placed: list[Placed]) -> bool:
    width, height = picture.size
    before = _before(wall, picture.along_m, width + 0.1, 0.1)
    return any(
        piece.size[2] > picture.above_m - height / 2 - 0.1 and overlap(before, piece.footprint()) for piece in placed
    )
