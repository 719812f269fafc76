"""A made-up or imported room as a reference room: true geometry, and the light of Cycles that leaves it.

    python -m tools.rooms.reference --room demo --to DIR [--views 260] [--samples 4] [--cell-m 0.016]

A policy is tested in it (``docs/policy.md``). ``DIR/light.npz`` is the surface light field, fitted to pictures by
Cycles from where heads can be: each next one is the one of several drawn that sees
most of what was seen least. ``DIR/collision`` is the true surface as a simulator takes it, ``DIR/pictures`` what was
rendered and from where: a command that was ended, or is given more ``--views``, goes on. Frozen views are never among
them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from demo.living_room.cameras import upright
from r2sego_blender.config.settings import CollisionSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import load_image
from r2sego_blender.core.json_files import read_json, write_json
from r2sego_blender.geometry.collision.collision import collision_surface
from r2sego_blender.geometry.collision.collision_files import write_collision
from r2sego_blender.geometry.proxy.proxy import GeometryProxy, Provenance
from r2sego_blender.geometry.texture.light_field_fitting import SAMPLES, LightSums
from r2sego_blender.geometry.texture.surface_light_field import SurfaceLightField, texel_counts
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer

from .folder import TrueRoom
from .free_floor import CELL_M, FreeFloor, free_floor

SIZE_PX = (256, 192)
_FOCAL_PX = 128.0  # 90 degrees across
_HEAD_M, _DOWN_DEG = (0.75, 1.4), (0.0, 60.0)  # from seated to standing
_CLEARANCE_M, _NEAREST_M = 0.1, 0.3
_DRAWN = 8  # places, of which the best is taken
_SEED = 46
_DEGREE, _RIDGE = 2, 0.25
_COARSE = 0.25  # of a picture's size, where only what it sees is asked


def main() -> None:
    """Build, render, fit and write."""
    from . import pictures, scenes  # Blender is not there for those who only read this

    options = _options(tuple(scenes.ROOMS))
    began_s = time.process_time()
    scene = scenes.ROOMS[options.room](options.data)
    pictures.set_up(Camera(*SIZE_PX, _FOCAL_PX, _FOCAL_PX, SIZE_PX[0] / 2, SIZE_PX[1] / 2, np.eye(4)), options.samples)
    pictures.render_exactly(options.threads)
    floor = free_floor(scene.truth.vertices, scene.truth.faces, scene.low, scene.high)
    rendered: Path = options.to / "pictures"
    rendered.mkdir(parents=True, exist_ok=True)
    known = [Camera.from_json(read_json(file)) for file in sorted(rendered.glob("*.json"))]
    for index, camera in enumerate(
        head_cameras(mesh_of(scene.truth, options.cell_m), floor, options.views, known), len(known)
    ):
        pictures.photograph(camera, rendered / f"{index:04d}.png", seed=index)
        write_json(rendered / f"{index:04d}.json", camera.to_json())
        known.append(camera)
    write_reference(options.to, scene.truth, known, rendered, options.cell_m)
    seconds = time.process_time() - began_s
    told = {
        "room": options.room,
        "views": len(known),
        "samples": options.samples,
        "last_run_processor_s": round(seconds),
    }
    write_json(options.to / "info.json", told)
    print(f"{options.to}: {seconds:.0f} s of processor")


def mesh_of(room: TrueRoom, cell_m: float, cameras: Sequence[Camera] = ()) -> SurfaceLightField:
    """The room's mesh with texels of ``cell_m``, dark; one a face where ``cameras`` are given and see none of it."""
    vertices, faces = room.vertices.astype(np.float32), room.faces.astype(np.int32)
    texels = texel_counts(vertices, faces, cell_m)
    if cameras:
        surface, seen = MeshRasterizer(vertices, faces), np.zeros(len(faces) + 1, bool)
        for camera in cameras:
            seen[surface.render(camera.scaled(SAMPLES)).face] = True
        texels[~seen[:-1]] = 1
    count = int(texels.astype(np.int64).prod(axis=1).sum())
    return SurfaceLightField(vertices, faces, texels, np.zeros((count, 1, 3), np.float32), np.zeros(3, np.float32))


def head_cameras(
    mesh: SurfaceLightField, floor: FreeFloor, count: int, known: Sequence[Camera] = ()
) -> Iterator[Camera]:
    """Cameras that with ``known`` are ``count``, each seeing most of what was seen least.

    Half of those it is chosen from are over the free floor, the others anywhere in the room with nothing close before
    them: a head leans over furniture, and over the seat of who sits.
    """
    rng = np.random.default_rng([_SEED, len(known)])
    places = floor.places(_CLEARANCE_M)
    lens = Camera(*SIZE_PX, _FOCAL_PX, _FOCAL_PX, SIZE_PX[0] / 2, SIZE_PX[1] / 2, np.eye(4))
    times = np.zeros(len(mesh.light))

    def look(camera: Camera) -> tuple[np.ndarray, float]:
        """What it sees, and how far away the nearest of it is."""
        texels, seen = mesh.texels_seen(camera.scaled(_COARSE))
        shown = texels >= 0
        return texels[shown], float(seen.depth[shown].min(initial=np.inf))

    for camera in known:
        times[np.unique(look(camera)[0])] += 1.0
    corners = floor.origin, floor.origin + np.array(floor.clearance_m.shape) * CELL_M
    left = count - len(known)
    while left > 0:
        best, most, seen = lens, 0.0, np.zeros(0, int)
        anywhere = rng.uniform(*corners, (_DRAWN // 2, 2))
        for place in (*places[rng.integers(len(places), size=_DRAWN // 2)], *anywhere):
            heading, down, height = (rng.uniform(*limits) for limits in ((-180.0, 180.0), _DOWN_DEG, _HEAD_M))
            camera = lens.at(upright(*place, height, heading, down))
            texels, nearest_m = look(camera)
            if nearest_m < _NEAREST_M:
                continue
            gain = float((1.0 / (1.0 + times[texels])).sum())
            if gain > most:
                best, most, seen = camera, gain, np.unique(texels)
        if most > 0.0:
            times[seen] += 1.0
            left -= 1
            yield best


def write_reference(folder: Path, room: TrueRoom, cameras: list[Camera], rendered: Path, cell_m: float) -> None:
    """``light.npz`` and ``collision`` of what ``rendered`` shows from ``cameras``."""
    sums = LightSums(mesh_of(room, cell_m, cameras), _DEGREE)
    for index, camera in enumerate(cameras):
        sums.add(load_image(rendered / f"{index:04d}.png"), camera)
    sums.fitted(_RIDGE).save(folder / "light.npz")
    count = len(room.faces)
    proxy = GeometryProxy(
        room.vertices.astype(np.float32),
        room.faces.astype(np.int32),
        np.full(count, Provenance.OBSERVED, np.uint8),
        np.ones(count, np.uint16),
        np.ones(count, np.float32),
    )
    write_collision(collision_surface(proxy, CollisionSettings()), folder / "collision")


def _options(rooms: tuple[str, ...]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--room", choices=rooms, required=True)
    parser.add_argument("--to", type=Path, required=True, help="the folder to make")
    parser.add_argument("--data", type=Path, default=Path("../shared/scenes"), help="where the meshes lie")
    parser.add_argument("--views", type=int, default=260, help="pictures by Cycles")
    parser.add_argument("--samples", type=int, default=4, help="Cycles samples a pixel")
    parser.add_argument("--cell-m", type=float, default=0.016, help="largest side of a texel")
    parser.add_argument("--threads", type=int, default=0, help="Cycles' threads; 0 for all")
    return parser.parse_args()


if __name__ == "__main__":
    main()
