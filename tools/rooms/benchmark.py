"""The benchmark's rooms: furnished by seed, photographed on walks and around, with frozen views and ground truth.

    python -m tools.rooms.benchmark --to DIR [--room warm ...] [--sets 6 around ...] [--width 320] [--samples 6]
    python -m tools.rooms.benchmark --to DIR --plans-only      # poses and figures without pictures, seconds a room

``DEVELOPMENT`` rooms may be tuned on; ``EVALUATION`` rooms are for evaluation alone. Each gets a folder: 45
captures of one walk, of which 6, 10, 15 and 30 are the smaller sets (``cameras_6.json`` ...), six around the room
that hardly overlap (``cameras_around.json``), and sixteen frozen views, eight farthest from the captures and eight
of a robot's routine, fixed by their SHA-256 in ``fixed.json`` before any picture is made. Poses, depth, instances
and mesh are as ``tools.rooms`` says. Pictures that are there are not rendered again: a run that was ended goes on.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from r2sego_blender.core.cameras import Camera
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

from .around import lens_of
from .folder import require_same, seen_view, views_digest, write_room
from .free_floor import FreeFloor, free_floor
from .furnished import development_styles, evaluation_styles
from .furnished.plan import RoomPlan, room_plan
from .furnished.style import Style
from .placing import captures_around, farthest_views
from .walking import NESTED, nested_sets, routine_views, walk_captures

FROZEN_OF_EACH = 8


@dataclass(frozen=True)
class BenchmarkRoom:
    """A room by style and seed, and how its walk goes: ``share`` of the way around, looking ``look_deg`` left."""

    style: Style
    seed: int
    share: float
    look_deg: float

    @property
    def name(self) -> str:
        return self.style.name

    def plan(self) -> RoomPlan:
        return room_plan(self.style, self.seed)


DEVELOPMENT = (
    BenchmarkRoom(development_styles.WARM, 0, 0.4, 70.0),
    BenchmarkRoom(development_styles.DINING, 0, 1.0, 90.0),
    BenchmarkRoom(development_styles.STUDY, 0, 0.15, 140.0),
)
EVALUATION = (
    BenchmarkRoom(evaluation_styles.LOFT, 0, 1.0, 90.0),
    BenchmarkRoom(evaluation_styles.NURSERY, 0, 1.0, 90.0),
    BenchmarkRoom(evaluation_styles.SUITE, 0, 0.4, 70.0),
)
ROOMS = {room.name: room for room in (*DEVELOPMENT, *EVALUATION)}


@dataclass(frozen=True)
class Cameras:
    """All cameras of a room, fixed before any picture is made."""

    walk: tuple[Camera, ...]
    around: tuple[Camera, ...]
    farthest: tuple[Camera, ...]
    routine: tuple[Camera, ...]


def place_cameras(room: BenchmarkRoom, surface: MeshRasterizer, floor: FreeFloor, lens: Camera) -> Cameras:
    """The same for a room whatever the lens's size."""
    eye_m = room.plan().eye_m
    walk = walk_captures(floor, lens, NESTED[-1], eye_m, room.share, room.look_deg, room.seed)
    around = captures_around(surface, floor, lens)
    farthest = farthest_views(surface, floor, [*walk, *around], FROZEN_OF_EACH, room.seed)
    return Cameras(
        tuple(walk), tuple(around), tuple(farthest), tuple(routine_views(floor, lens, FROZEN_OF_EACH, room.seed))
    )


def main() -> None:
    """Make the rooms that are asked for, one after the other."""
    options = parse_options()
    for name in options.room:
        make_room(ROOMS[name], options.to / name, options)


def make_room(room: BenchmarkRoom, folder: Path, options: argparse.Namespace) -> None:
    """Build, place, render what is not there yet, and write one room."""
    from . import pictures, scenes  # Blender is not there for those who only read this
    from .furnished.building import build

    started_s = time.monotonic()
    plan = room.plan()
    build(plan)
    truth = scenes.standing_surface()
    built_s = time.monotonic() - started_s
    surface = MeshRasterizer(truth.vertices, truth.faces)
    floor = free_floor(truth.vertices, truth.faces, -plan.layout.half, plan.layout.half)
    lens = lens_of(options.width)
    cameras = place_cameras(room, surface, floor, lens)
    named = {
        kind: [seen_view(f"{kind}_{index:02d}", camera, surface, truth) for index, camera in enumerate(of_kind)]
        for kind, of_kind in vars(cameras).items()
    }
    frozen = [*named["farthest"], *named["routine"]]
    sets = {str(size): [named["walk"][i] for i in chosen] for size, chosen in nested_sets().items()}
    sets["around"] = named["around"]
    others = {name: sets.pop(name) for name in tuple(sets) if name not in options.sets}
    placed_s = time.monotonic() - started_s
    fixed = {
        "plan_sha256": plan.digest(),
        "captures_sha256": views_digest([*named["walk"], *named["around"]]),
        "frozen_sha256": views_digest(frozen),
        "samples": options.samples,
    }
    require_same(folder, fixed)
    pictures.set_up(lens, options.samples)
    wanted = {view.name: view for views in sets.values() for view in views}
    rendered = 0
    for kind, views in (("frozen", frozen), ("photographs", wanted.values())):
        (folder / kind).mkdir(parents=True, exist_ok=True)
        for view in views:
            file = folder / kind / f"{view.name}.png"
            if not file.is_file() and not options.plans_only:
                pictures.photograph(view.camera, file)
                rendered += 1
    told = {
        "room": room.name,
        "for": "development" if room in DEVELOPMENT else "evaluation alone",
        "seed": room.seed,
        **fixed,
        "walk_share": room.share,
        "seconds": {
            "built": round(built_s, 1),
            "placed": round(placed_s, 1),
            "all": round(time.monotonic() - started_s),
        },
        "rendered": rendered,
    }
    info = write_room(folder, truth, sets, frozen, told, others)
    gaps = ", ".join(f"{name}: {info[name]['support_gap']:.0%}" for name in (*sets, *others))
    print(f"{folder}: {info['seconds']['all']} s for {rendered} pictures; support gap {gaps}", flush=True)


def parse_options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options of the command line."""
    names = [*map(str, NESTED), "around"]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--to", type=Path, required=True, help="the folder of the rooms' folders")
    parser.add_argument("--room", nargs="+", choices=tuple(ROOMS), default=tuple(ROOMS))
    parser.add_argument(
        "--sets", nargs="+", choices=names, default=names, help="capture sets to write; the others are measured alone"
    )
    parser.add_argument("--width", type=int, default=320, help="pixels across")
    parser.add_argument("--samples", type=int, default=6, help="Cycles samples a pixel")
    parser.add_argument("--plans-only", action="store_true", help="no pictures: poses, depth and figures")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
