"""A small bundle with rounds, made without refining: a wall over a floor, and splats on it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from bundles import new_bundle
from room_meshes import observed_proxy

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.store import save_captures
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.splats.asset import SplatAsset
from r2sego_blender.splats.formats.ply import save_ply
from r2sego_blender.splats.training.initialization import from_depth

WIDTH, HEIGHT = 64, 48
PHOTOGRAPH = 0.5
VERTICES = np.array([(-4, 2, 0), (4, 2, 0), (4, 2, 4), (-4, 2, 4), (-4, -3, 0), (4, -3, 0)], np.float64)
FACES = np.array([(0, 1, 2), (0, 2, 3), (4, 5, 1), (4, 1, 0)], np.int32)


def camera(x: float = 0.0) -> Camera:
    """Looks at the wall, 2 m away, and a little of the floor."""
    return Camera(WIDTH, HEIGHT, 50.0, 50.0, WIDTH / 2, HEIGHT / 2, look_at((x, 0.0, 1.0), (x, 2.0, 0.9)))


def splats(grey: float, at: Camera | None = None, columns: slice = slice(None)) -> SplatAsset:
    """Discs of one grey on wall and floor where ``at`` sees them in ``columns``."""
    at = at or camera()
    large = at.scaled(2.0)
    depth = MeshRasterizer(VERTICES, FACES).render(large).depth
    mask = np.zeros(large.shape, bool)
    mask[:, slice(*(None if c is None else 2 * c for c in (columns.start, columns.stop)))] = True
    return from_depth(large, depth, np.full((*large.shape, 3), grey, np.float32), 2, mask)


def photographs(folder: Path, xs: Sequence[float], name: str) -> list[Capture]:
    """Grey photographs from places along the wall."""
    made = []
    for index, x in enumerate(xs):
        path = folder / f"{name}_{index}.png"
        save_image(path, np.full((HEIGHT, WIDTH, 3), PHOTOGRAPH, np.float32))
        made.append(Capture(f"{name}_{index}", path, camera(x)))
    return made


def bundle(
    folder: Path,
    assets: Sequence[SplatAsset | None],
    backdrop: SplatAsset | None,
    proxy: GeometryProxy | None = None,
    world_from_capture: np.ndarray | None = None,
) -> Scene:
    """A bundle with a round for each of ``assets``; None leaves that round's asset out."""
    captures = photographs(folder, (-0.4, 0.4), "capture")
    proxy = proxy or observed_proxy(VERTICES, FACES)

    def fill(place: Path) -> None:
        save_captures(place / "captures", captures)
        (place / "geometry").mkdir()
        if backdrop is not None:
            save_ply(place / "geometry/backdrop.ply", backdrop)
        for index, asset in enumerate(assets):
            (place / f"rounds/{index}/proxy").mkdir(parents=True)
            proxy.save(place / f"rounds/{index}/proxy/proxy.npz")
            if asset is not None:
                save_ply(place / f"rounds/{index}/asset.ply", asset)

    similarity = np.eye(4) if world_from_capture is None else world_from_capture
    return new_bundle(
        folder / "room.r2s",
        fill,
        world_from_capture=tuple(map(tuple, similarity.tolist())),
        overrides={"rounds": len(assets)},
    )
