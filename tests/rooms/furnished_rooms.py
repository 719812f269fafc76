"""Furnished rooms by chance, ray cast in numpy: pictures of captures around them that share little, exact depth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image

PLAIN, WOOD, TILES, BOOKS, RUG = range(5)


@dataclass(frozen=True)
class Box:
    """An upright box: ``centre`` and ``half`` sizes (3,) in metres, turned by ``yaw`` rad about z; its ``paint``."""

    centre: np.ndarray
    half: np.ndarray
    yaw: float
    colour: np.ndarray
    paint: int = PLAIN


@dataclass(frozen=True)
class FurnishedRoom:
    """``low``, ``high`` (3,) in axes turned by ``yaw`` rad about z; ``boxes`` in those axes; colours of the six sides
    (x low, x high, y low, y high, floor, ceiling)."""

    low: np.ndarray
    high: np.ndarray
    yaw: float
    boxes: tuple[Box, ...]
    colours: np.ndarray
    floor: int
    seed: int

    @property
    def world_from_room(self) -> np.ndarray:
        """(3, 3) the turn."""
        return _turn(self.yaw)


def _turn(yaw: float) -> np.ndarray:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def furnished_room(seed: int) -> FurnishedRoom:
    """A room of 3.2 to 6 m a side, furnished along its walls and in its middle."""
    rng = np.random.default_rng(seed)
    size = np.array([rng.uniform(3.2, 6.0), rng.uniform(3.2, 5.5), rng.uniform(2.3, 2.9)])
    low = np.append(-size[:2] * rng.uniform(0.4, 0.6, 2), 0.0)
    high = low + size
    wall = rng.uniform(0.35, 0.9) + rng.uniform(-0.08, 0.08, 3)
    colours = np.clip(wall + rng.uniform(-0.04, 0.04, (6, 1)), 0.05, 0.95)
    if rng.random() < 0.6:
        colours[rng.integers(4)] = rng.uniform(0.15, 0.8, 3)
    colours[4] = rng.uniform(0.15, 0.6) * np.array([1.0, rng.uniform(0.6, 0.95), rng.uniform(0.35, 0.9)])
    colours[5] = rng.uniform(0.75, 0.95)
    boxes: list[Box] = []
    for side in range(4):
        boxes += _along(rng, side, low, high)
    middle = (low + high)[:2] / 2
    if rng.random() < 0.7:
        half = np.array([rng.uniform(0.7, 1.3), rng.uniform(0.5, 0.9), 0.004])
        boxes.append(Box(np.append(middle + rng.uniform(-0.3, 0.3, 2), 0.004), half, 0.0, _colour(rng), RUG))
    table = rng.random() < 0.8
    if table:
        boxes += _table(rng, middle + rng.uniform(-0.4, 0.4, 2), 0.0 if rng.random() < 0.7 else rng.uniform(0, 1.5))
    for _ in range(rng.integers(0, 4)):
        place = middle + rng.uniform(0.6, 1.1) * _direction(rng.uniform(0, 2 * np.pi))
        boxes += _chair(rng, place, rng.uniform(0, 2 * np.pi))
    return FurnishedRoom(
        low, high, rng.uniform(0, np.pi / 2), tuple(boxes), colours, int(rng.choice([WOOD, TILES])), seed
    )


def _direction(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def _colour(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(0.1, 0.8) + rng.uniform(-0.2, 0.2, 3)


def _along(rng: np.random.Generator, side: int, low: np.ndarray, high: np.ndarray) -> list[Box]:
    """What stands and hangs along one wall."""
    axis, along = side // 2, 1 - side // 2
    wall = (low, high)[side % 2][axis]
    inward = 1.0 if side % 2 == 0 else -1.0
    found = []

    def box(at: float, width: float, deep: float, bottom: float, top: float, colour, paint=PLAIN, off=0.0) -> Box:
        centre, half = np.zeros(3), np.zeros(3)
        centre[axis], half[axis] = wall + inward * (off + deep / 2), deep / 2
        centre[along], half[along] = at, width / 2
        centre[2], half[2] = (bottom + top) / 2, (top - bottom) / 2
        return Box(centre, half, 0.0, colour, paint)

    window = rng.random() < 0.4
    if window:
        wide, sill, top = rng.uniform(1.0, 2.4), rng.uniform(0.6, 0.95), rng.uniform(1.9, 2.2)
        middle, white = (low + high)[along] / 2 + rng.uniform(-0.4, 0.4), np.full(3, 0.85)
        found.append(box(middle, wide, 0.01, sill, top, np.array([0.75, 0.8, 0.88])))
        for edge in (-wide / 2, rng.uniform(-0.2, 0.2), wide / 2):
            found.append(box(middle + edge, 0.06, 0.03, sill, top, white))
        found.append(box(middle, wide + 0.1, 0.04, top, top + 0.06, white))
        found.append(box(middle, wide + 0.2, 0.16, sill - 0.05, sill, white))
        if rng.random() < 0.3:
            found.append(box(middle - wide / 2, 0.5, 0.1, 0.03, top + 0.2, _colour(rng), BOOKS))
    at = low[along] + rng.uniform(0.0, 0.6)
    while at < high[along] - 0.6:
        kind = rng.integers(6)
        width = min(rng.uniform(0.6, 2.0), high[along] - at - 0.05)
        colour, middle = _colour(rng), at + width / 2
        if kind == 0:
            found.append(box(middle, width, rng.uniform(0.25, 0.4), 0.0, rng.uniform(1.5, 2.1), colour, BOOKS))
        elif kind == 1:
            found.append(box(middle, width, rng.uniform(0.35, 0.6), 0.0, rng.uniform(0.5, 1.0), colour))
        elif kind == 2:
            found.append(box(middle, width, 0.85, 0.05, 0.42, colour))
            found.append(box(middle, width, 0.22, 0.42, 0.85, colour * 0.95))
            found.append(box(at + 0.1, 0.2, 0.85, 0.0, 0.6, colour * 1.05))
            found.append(box(at + width - 0.1, 0.2, 0.85, 0.0, 0.6, colour * 1.05))
        elif kind == 3:
            found.append(box(middle, 0.85, 0.04, 0.0, 2.0, colour))
        if kind != 0 and kind != 3 and not window and rng.random() < 0.7:
            bottom = rng.uniform(1.2, 1.5)
            found.append(
                box(middle, rng.uniform(0.3, width), 0.03, bottom, bottom + rng.uniform(0.3, 0.8), _colour(rng), BOOKS)
            )
        at += width + rng.uniform(0.1, 1.2)
    return found


def _part(place: np.ndarray, yaw: float, x, y, z, half, colour, paint=PLAIN) -> Box:
    offset = _turn(yaw) @ np.array([x, y, z])
    return Box(np.append(place, 0.0) + offset, np.array(half), yaw, colour, paint)


def _legs(place, yaw, x, y, height, colour) -> list[Box]:
    return [
        _part(place, yaw, i * x, j * y, height / 2, (0.03, 0.03, height / 2), colour) for i in (-1, 1) for j in (-1, 1)
    ]


def _table(rng: np.random.Generator, place: np.ndarray, yaw: float) -> list[Box]:
    x, y, height, colour = rng.uniform(0.4, 0.8), rng.uniform(0.3, 0.5), rng.uniform(0.4, 0.78), _colour(rng)
    parts = [
        _part(place, yaw, 0, 0, height, (x, y, 0.025), colour, WOOD),
        *_legs(place, yaw, x - 0.05, y - 0.05, height, colour),
    ]
    for _ in range(rng.integers(0, 3)):
        size = rng.uniform(0.04, 0.14)
        parts.append(
            _part(
                place, yaw, rng.uniform(-x, x) * 0.7, rng.uniform(-y, y) * 0.7, height + size, (size,) * 3, _colour(rng)
            )
        )
    return parts


def _chair(rng: np.random.Generator, place: np.ndarray, yaw: float) -> list[Box]:
    colour = _colour(rng)
    return [
        _part(place, yaw, 0, 0, 0.45, (0.22, 0.22, 0.03), colour),
        _part(place, yaw, 0, 0.2, 0.7, (0.22, 0.02, 0.25), colour * 0.9),
        *_legs(place, yaw, 0.19, 0.19, 0.45, colour * 0.8),
    ]


def around(room: FurnishedRoom, rng: np.random.Generator, count: int = 6, width: int = 320) -> list[Camera]:
    """Cameras at eye height around the room's middle, each looking another way: neighbours share next to nothing."""
    middle, reach = (room.low + room.high)[:2] / 2, (room.high - room.low)[:2]
    begin, first = rng.uniform(0, 2 * np.pi), rng.uniform(-0.3, 0.25)
    cameras = []
    for index in range(count):
        angle = begin + 2 * np.pi * index / count
        # From the far side of the middle through it, or outwards, and never inside of furniture.
        for shift in (first, 0.15, 0.05, -0.05, -0.15, 0.0):
            place = middle - shift * reach * _direction(angle) + rng.uniform(-0.15, 0.15, 2)
            if not any(_within(box, place) for box in room.boxes):
                break
        height = rng.uniform(1.45, 1.62)
        target = np.append(
            place + _direction(angle + rng.uniform(-0.15, 0.15)), height - np.tan(np.radians(rng.uniform(8, 20)))
        )
        turn = room.world_from_room
        pose = look_at(turn @ np.append(place, height), turn @ target)
        cameras.append(Camera(width, width * 3 // 4, 0.6 * width, 0.6 * width, width / 2, width * 3 / 8, pose))
    return cameras


def _within(box: Box, place: np.ndarray, margin: float = 0.2) -> bool:
    local = _turn(-box.yaw)[:2, :2] @ (place - box.centre[:2])
    return bool((np.abs(local) < box.half[:2] + margin).all() and box.half[2] > 0.01)


def render(room: FurnishedRoom, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The picture (H, W, 3) float32 and planar depth (H, W) float32."""
    back = room.world_from_room.T
    rays = (camera.rays() @ camera.world_from_camera[:3, :3].T) @ back.T
    origin = back @ camera.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.maximum((room.low - origin) / rays, (room.high - origin) / rays)
    axis = ends.argmin(-1)
    depth = ends.min(-1)
    points = origin + rays * depth[..., None]
    side = np.where(np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0, 2 * axis + 1, 2 * axis)
    colour = room.colours[side] * _painted(room, points, side)[..., None]
    normal_light = np.array([0.78, 0.92, 0.85, 0.97, 1.0, 0.9])[side]
    for index, box in enumerate(room.boxes):
        turn = _turn(-box.yaw)
        local, start = rays @ turn.T, turn @ (origin - box.centre)
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-box.half - start) / local, (box.half - start) / local
        near = np.minimum(a, b)
        entry = near.max(-1)
        hit = (entry <= np.maximum(a, b).min(-1)) & (entry > 0.05) & (entry < depth)
        if not hit.any():
            continue
        face = near.argmax(-1)[hit]
        depth[hit] = entry[hit]
        on = start + local[hit] * entry[hit][:, None]
        colour[hit] = np.clip(box.colour, 0.03, 0.95) * _box_paint(room.seed * 97 + index, box, on, face)
        normal_light[hit] = np.array([0.75, 0.88, 1.05])[face]
    points = origin + rays * depth[..., None]
    corner = np.minimum(points - room.low, room.high - points)
    shade = 1.0 - 0.25 * np.exp(-np.sort(corner, -1)[..., :2].sum(-1) / 0.25)
    lamp = np.array([*(room.low + room.high)[:2] / 2, room.high[2] - 0.3])
    falloff = 1.15 / (1.0 + 0.06 * ((points - lamp) ** 2).sum(-1))
    image = colour * (normal_light * shade * falloff)[..., None]
    noise = np.random.default_rng(room.seed).normal(0, 0.008, image.shape)
    return np.clip(image + noise, 0, 1).astype(np.float32), depth.astype(np.float32)


def _waves(points: np.ndarray, seed: int, wavelength_m: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    total = np.zeros(points.shape[:-1])
    for _ in range(5):
        direction = rng.normal(size=3)
        total += np.sin(points @ direction * (6.0 / wavelength_m) + rng.uniform(0, 6))
    return total / 5


def _hash(*cells: np.ndarray) -> np.ndarray:
    """A number in [0, 1) for each cell."""
    value = sum(np.floor(cell) * weight for cell, weight in zip(cells, (12.9898, 78.233, 37.719), strict=False))
    return np.modf(np.abs(np.sin(value) * 43758.5453))[0]


def _painted(room: FurnishedRoom, points: np.ndarray, side: np.ndarray) -> np.ndarray:
    """(H, W) brightness of floor, walls and ceiling."""
    x, y, z = np.moveaxis(points, -1, 0)
    rough = 0.3 + 1.7 * (room.seed % 3)  # of three rooms one is smooth
    plain = 1.0 + rough * (0.03 * _waves(points, room.seed, 0.9) + 0.03 * _waves(points, room.seed + 1, 0.2))
    if room.floor == WOOD:
        row = y / 0.14
        floor = 0.75 + 0.4 * _hash(row, x / 1.1 + 7 * _hash(row)) + 0.1 * np.sin(90 * y + 9 * np.sin(3 * x))
        floor = np.where(np.modf(np.abs(row))[0] < 0.06, 0.5, floor)
    else:
        edge = np.minimum(np.modf(np.abs(x / 0.4))[0], np.modf(np.abs(y / 0.4))[0])
        floor = np.where(edge < 0.03, 0.55, 0.9 + 0.15 * _hash(x / 0.4, y / 0.4))
    skirting = np.where(z < 0.07, 0.8, plain)
    return np.where(side == 4, floor, np.where(side < 4, skirting, plain))


def _box_paint(seed: int, box: Box, on: np.ndarray, face: np.ndarray) -> np.ndarray:
    """(n, 3) factors of a box's colour."""
    plain = 1.0 + 0.05 * _waves(on, seed, 0.3)
    if box.paint == BOOKS:
        across = np.where(face == 0, on[:, 1], on[:, 0])
        cells = np.stack([_hash(across / 0.05 + 3 * k, on[:, 2] / 0.32 + 5 * k) for k in range(3)], -1)
        return 0.4 + 1.2 * cells
    if box.paint == RUG:
        cells = np.stack([_hash(on[:, 0] / 0.2 + 3 * k, on[:, 1] / 0.2 + 5 * k) for k in range(3)], -1)
        return 0.5 + cells
    if box.paint == WOOD:
        plain = plain + 0.15 * np.sin(60 * on[:, 1] + 5 * np.sin(4 * on[:, 0]))
    return np.repeat(plain[:, None], 3, 1)


def write_captures(folder: Path, room: FurnishedRoom, cameras: list[Camera]) -> tuple[list[Capture], list[np.ndarray]]:
    """The photographs on disk, and the exact depth of each."""
    captures, depths = [], []
    for index, camera in enumerate(cameras):
        image, depth = render(room, camera)
        path = folder / f"photo{index}.png"
        save_image(path, image)
        captures.append(Capture(path.name, path, camera))
        depths.append(depth)
    return captures, depths
