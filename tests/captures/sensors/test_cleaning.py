"""What is believed of a sensor's map: slanted surfaces, no flying pixels, nothing edge-on."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from r2sego_blender.captures.sensors.cleaning import SENSOR_SIGMA, believed, normals
from r2sego_blender.core.cameras import Camera, look_at

CAMERA = Camera(64, 48, 50.0, 52.0, 31.0, 25.0, look_at([1.0, 2.0, 3.0], [0.0, 0.5, 1.0]))


def _plane(normal: np.ndarray, offset_m: float) -> np.ndarray:
    """Planar depth of the plane n.x = -offset in the camera's frame, 0 where it is not seen."""
    towards = CAMERA.rays() @ normal
    depth = np.divide(-offset_m, towards, out=np.zeros(CAMERA.shape), where=towards < -0.05)
    return np.where(depth < 40.0, depth, 0.0).astype(np.float32)


@given(x=st.floats(-1.0, 1.0), y=st.floats(-1.0, 1.0), distance_m=st.floats(0.3, 6.0))
def test_normals_of_a_plane_are_its_own(x: float, y: float, distance_m: float) -> None:
    normal = np.array([x, y, -1.0]) / np.linalg.norm([x, y, -1.0])
    depth = _plane(normal, distance_m)
    known = depth > 0.0
    assume(known.any(axis=0).sum() > 1 and known.any(axis=1).sum() > 1)
    found, cosine = normals(depth, CAMERA)
    inner = known & np.roll(known, 1, 0) & np.roll(known, 1, 1) & np.roll(known, -1, 0) & np.roll(known, -1, 1)
    inner[[0, -1]] = inner[:, [0, -1]] = False
    world = CAMERA.world_from_camera[:3, :3] @ normal
    assert np.abs(found[inner] - world).max(initial=0.0) < 2e-3
    rays = CAMERA.rays() / np.linalg.norm(CAMERA.rays(), axis=2, keepdims=True)
    assert np.abs(cosine[inner] + (rays @ normal)[inner]).max(initial=0.0) < 2e-3
    assert (found[~known] == 0.0).all()


def test_what_lies_between_two_surfaces_is_dropped_and_they_stay() -> None:
    depth = np.full(CAMERA.shape, 2.0, np.float32)
    depth[:, :30] = 1.0
    mixed = depth.copy()
    mixed[:, 30] = 1.5  # what a sensor makes of an edge
    kept, _ = believed(mixed, np.ones_like(mixed), CAMERA)
    assert (kept[:, 30] == 0.0).all()
    assert (kept[:, :29] == 1.0).all() and (kept[:, 32:] == 2.0).all()


def test_a_surface_seen_edge_on_is_not_believed_and_doubt_grows_towards_it() -> None:
    square, slanted, grazing = (
        believed(_plane(np.array([np.sin(a), 0.0, -np.cos(a)]), 1.0), np.ones(CAMERA.shape), CAMERA)
        for a in np.radians([0.0, 60.0, 84.0])
    )
    middle = (24, 31)
    assert np.isclose(square[1][middle], SENSOR_SIGMA * square[0][middle], rtol=1e-3)
    relative = slanted[1][middle] / slanted[0][middle]
    assert 1.8 * SENSOR_SIGMA < relative < 2.3 * SENSOR_SIGMA
    assert grazing[0][middle] == 0.0


def test_less_confidence_and_more_distance_are_less_sure() -> None:
    depth = np.full(CAMERA.shape, 6.0, np.float32)
    near, far = believed(depth / 3.0, np.ones_like(depth), CAMERA), believed(depth, np.ones_like(depth), CAMERA)
    doubted = believed(depth / 3.0, np.full_like(depth, 2.0), CAMERA)
    middle = (24, 31)
    assert far[1][middle] / 6.0 > 1.9 * near[1][middle] / 2.0
    assert np.isclose(doubted[1][middle], 2.0 * near[1][middle])
