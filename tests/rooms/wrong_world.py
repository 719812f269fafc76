"""Captures in a world whose floor or metre is wrong, and what a person would show to put it right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bundles import new_bundle
from measured_points import measured
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.frame.floor_points import FloorPoint
from r2sego_blender.captures.frame.picks import Pick, PickedLength, PickedPoint, Picks
from r2sego_blender.captures.store import load_captures, save_captures
from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.images import save_image

LENS = Camera(160, 120, 110.0, 112.0, 78.0, 61.0, np.eye(4))
FLOOR = np.array([[-0.8, 1.0, 0.0], [0.9, 1.1, 0.0], [0.3, 2.4, 0.0], [-0.5, 2.0, 0.0]])


def true_cameras(count=4):
    """Cameras over a floor at z = 0, the first above the origin and heading along x."""
    poses = [look_at([0.4 * i, 0.1 * i, 1.4 + 0.05 * i], [0.1, 1.7, 0.1]) for i in range(count)]
    heading = poses[0][:3, 2]
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("z", -np.arctan2(heading[1], heading[0])).as_matrix()
    return turn, [LENS.at(turn @ pose) for pose in poses]


def _sparse(cameras, turn):
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 25), np.linspace(0.6, 3.0, 25))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) @ turn[:3, :3].T
    return measured(points, cameras, least_views=2)


def wrong_similarity(seed=0, scale=1.0, tilt_deg=5.0):
    """What took the true world to a wrong one."""
    rng = np.random.default_rng(seed)
    similarity = np.eye(4)
    axis = rng.normal(size=3) * [1, 1, 0.2]
    turn = Rotation.from_rotvec(np.radians(tilt_deg) * axis / np.linalg.norm(axis))
    similarity[:3, :3] = scale * turn.as_matrix()
    similarity[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    return similarity


def wrong_scene(folder, similarity, source="metric poses"):
    """A bundle of the true world taken by ``similarity``; the true heading's turn, and cameras."""
    turn, cameras = true_cameras()
    captures = []
    for index, camera in enumerate(cameras):
        save_image(folder / f"p{index}.png", np.random.default_rng(index).random((120, 160, 3)).astype(np.float32))
        captures.append(Capture(f"p{index}.jpg", folder / f"p{index}.png", camera.transformed(similarity)))
    sparse = _sparse(cameras, turn).transformed(similarity)

    def fill(place: Path) -> None:
        save_captures(place / "captures", captures, sparse)
        (place / "captures" / "masks").mkdir()
        (place / "captures" / "masks" / "chair.png").write_bytes(b"drawn by hand")

    given = tuple(map(tuple, (2.0 * np.diag([1, 1, 1, 0.5])).tolist()))
    scene = new_bundle(folder / "room.r2s", fill, world_from_capture=given, ground="no floor seen", scale_source=source)
    return scene, turn, cameras


def shown_points(turn, cameras, spots=FLOOR, views=(0, 2)):
    """Points of the floor as a person would click them."""
    spots = spots @ turn[:3, :3].T
    return [FloorPoint(tuple((f"p{v}", tuple(cameras[v].project(spot)[0])) for v in views)) for spot in spots]


def assert_true(scene, cameras, places_m=1e-6):
    """The scene's captures stand where the true ``cameras`` do, with their lenses."""
    for capture, camera in zip(load_captures(scene.captures_folder), cameras, strict=True):
        assert np.abs(capture.camera.world_from_camera - camera.world_from_camera).max() < places_m
        assert (capture.camera.fx, capture.camera.fy, capture.camera.cx) == (110.0, 112.0, 78.0)


def picked_points(turn, cameras, metres=None, views=(0, 2, 3)):
    """Four points of the floor as a person picks them, and the length between two of them."""
    names = "ABCD"
    points = tuple(
        PickedPoint(name, tuple(Pick(f"p{v}.jpg", *map(float, cameras[v].project(spot)[0])) for v in views), floor=True)
        for name, spot in zip(names, FLOOR @ turn[:3, :3].T, strict=True)
    )
    length = float(np.linalg.norm(FLOOR[0] - FLOOR[1])) if metres is None else metres
    return Picks(points, (PickedLength("A", "B", length),))
