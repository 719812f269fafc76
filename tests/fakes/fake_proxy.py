"""What the room Proxy reads of a bundle: objects with masks, priors, coverage and edits."""

import json
from pathlib import Path

import numpy as np

from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.images import save_image
from r2sego_blender.geometry.proxy.edited_proxy import cut_of
from r2sego_blender.geometry.proxy.edits import Edit
from r2sego_blender.geometry.proxy.proxy import GeometryProxy
from r2sego_blender.geometry.visibility.coverage import Coverage, face_areas

CRATE_FROM_OWN = np.array([[0.0, -0.5, 0, 0.1], [0.5, 0, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])
"""Where the crate, a cube of side 2 in its own frame, stands: 1 m wide, turned by 90 degrees."""


def crate() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the crate in its own frame."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))], np.int32)


def crate_mask(camera: Camera) -> np.ndarray:
    """(H, W) bool: the crate in an image, by the half-planes around its convex outline."""
    vertices = crate()[0] @ CRATE_FROM_OWN[:3, :3].T + CRATE_FROM_OWN[:3, 3]
    pixels, _ = camera.project(vertices)
    mask = np.ones(camera.shape, bool)
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    for a in pixels:
        for b in pixels:
            side = np.cross(b - a, pixels - a)
            if (side >= -1e-9).all() and (side > 1e-9).any():
                mask &= (b - a)[0] * (y - a[1]) - (b - a)[1] * (x - a[0]) >= 0
    return mask


def write_objects(folder: Path, cameras: dict[str, Camera]) -> None:
    """A crate that was aligned, and a lamp that was refused."""
    for name in ("crate", "lamp"):
        (folder / "objects" / name / "masks").mkdir(parents=True)
        for capture, camera in cameras.items():
            mask = crate_mask(camera).astype(np.float32)
            save_image(folder / "objects" / name / "masks" / f"{capture}.png", np.repeat(mask[..., None], 3, 2))
    priors = folder / "geometry" / "priors"
    (priors / "refused").mkdir(parents=True)
    vertices, faces = crate()
    world = vertices @ CRATE_FROM_OWN[:3, :3].T + CRATE_FROM_OWN[:3, 3]
    np.savez(priors / "crate.npz", vertices=world, faces=faces)
    np.savez(priors / "refused" / "lamp.npz", vertices=world, faces=faces)
    figures = {
        "backend": "mesh",
        "shape": "box",
        "energy": 0.1,
        "point_distance_m": 0.01,
        "world_from_own": CRATE_FROM_OWN.tolist(),
    }
    record = [
        {"name": "crate", "refusal": "", "silhouette_iou": 0.95, **figures},
        {"name": "lamp", "refusal": "it overlaps too little", "silhouette_iou": 0.3, **figures},
    ]
    (priors / "priors.json").write_text(json.dumps(record))
    rng = np.random.default_rng(2)
    points = np.concatenate([world[faces].mean(1), rng.uniform(-1.4, 1.4, (20, 3))]).astype(np.float32)
    np.savez(
        folder / "geometry" / "observed.npz",
        points=points,
        visibility=np.ones((len(points), len(cameras)), bool),
        normals=np.zeros_like(points),
        colours=np.zeros_like(points),
        confidence=np.ones(len(points), np.float32),
    )


def write_coverage(folder: Path, proxy: GeometryProxy) -> None:
    """The coverage of a round: faces 0 and 1 are seen by no candidate."""
    count = len(proxy.faces)
    (folder / "coverage").mkdir()
    seen = np.where(np.arange(count) < 2, 0, np.arange(count)).astype(np.uint32)
    areas = face_areas(proxy.vertices, proxy.faces)
    Coverage(seen, proxy.support, areas, 40).save(folder / "coverage" / "coverage.npz")


def write_edit(folder: Path, proxy: GeometryProxy) -> None:
    """One edit: the last face cut away."""
    (folder / "geometry" / "edits").mkdir(parents=True)
    Edit("hole", 1, cut_of(proxy, proxy.vertices[proxy.faces[-1:]])).save(folder / "geometry" / "edits")
