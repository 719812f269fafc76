"""Mirror planes of made-up furniture, seen from one side of a made-up room."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from furniture import FURNITURE, boxes, moved, observed_object, standing
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.objects.mirrored_surface import mirrored_surface
from r2sego_blender.geometry.objects.symmetry import MirrorPlane, ObjectSight, find_mirror_planes

GATE = 0.4
PLACE = (0.2, 0.1)
ASYMMETRIC = {
    "corner bench": lambda: boxes(
        ((-0.7, -0.5, 0), (0.7, -0.05, 0.45)),
        ((-0.7, -0.05, 0), (-0.3, 0.6, 0.45)),
        ((-0.7, -0.5, 0.45), (-0.6, 0.6, 0.9)),
    ),
    "stairs": lambda: boxes(
        ((-0.6, -0.3, 0), (-0.2, 0.3, 0.3)), ((-0.2, -0.3, 0), (0.1, 0.1, 0.6)), ((0.1, -0.3, 0), (0.6, -0.1, 1.1))
    ),
    "desk with a tower": lambda: boxes(
        ((-0.7, -0.35, 0.7), (0.7, 0.35, 0.75)),
        ((0.3, -0.35, 0), (0.7, 0.35, 0.7)),
        ((0.35, -0.3, 0.75), (0.7, 0.0, 1.3)),
        ((-0.7, -0.3, 0), (-0.65, 0.3, 0.7)),
    ),
}


def seen_from_one_side(mesh, heading_deg: float) -> SimpleNamespace:
    """What four cameras before an object see of it; its far side stays unseen."""
    vertices, faces = mesh
    vertices = moved(vertices, standing(heading_deg, PLACE))
    cameras = []
    for angle in (-0.9, -0.3, 0.3, 0.9):
        centre = (PLACE[0] + 1.9 * np.sin(angle), PLACE[1] - 1.9 * np.cos(angle), 1.5)
        cameras.append(Camera(320, 240, 250, 250, 160, 120, look_at(centre, (*PLACE, 0.5))))
    seen = observed_object(vertices, faces, cameras, np.random.default_rng(3), noise_m=0.006, count=3000)
    sight = ObjectSight.of(cameras, seen.masks, seen.depths, seen.depths)
    return SimpleNamespace(**vars(seen), sight=sight, vertices=vertices, faces=faces)


def self_distance_m(plane: MirrorPlane, seen: SimpleNamespace) -> float:
    """How far the object's mirror image lies from the object, on average."""
    mesh = trimesh.Trimesh(seen.vertices, seen.faces, process=False)
    samples = trimesh.sample.sample_surface(mesh, 6000, seed=0)[0]
    return float(cKDTree(samples).query(plane.mirrored(samples))[0].mean())


@pytest.mark.parametrize("name", ["table", "stool", "cupboard", "lamp"])
@pytest.mark.parametrize("heading_deg", [0.0, 33.0])
def test_symmetric_furniture_is_its_mirror_image(name, heading_deg):
    seen = seen_from_one_side(FURNITURE[name](), heading_deg)
    planes = find_mirror_planes(seen.points, seen.sight, GATE)
    assert planes
    for plane in planes:
        assert self_distance_m(plane, seen) < 0.025
        assert abs(np.linalg.norm(plane.normal) - 1) < 1e-12 and plane.normal[2] == 0
        assert plane.energy <= GATE and plane.confirmed >= 0.25
    if len(planes) == 2:
        assert abs(planes[0].normal @ planes[1].normal) < 0.25


@pytest.mark.parametrize("name", ASYMMETRIC)
@pytest.mark.parametrize("heading_deg", [-60.0, 0.0, 45.0, 110.0, 180.0])
def test_no_plane_is_found_in_what_has_none(name, heading_deg):
    seen = seen_from_one_side(ASYMMETRIC[name](), heading_deg)
    assert find_mirror_planes(seen.points, seen.sight, GATE) == ()


def test_the_mirrored_surface_is_true_and_was_not_observed():
    """Two sides of a crate are seen: two planes give the other two."""
    seen = seen_from_one_side(boxes(((-0.35, -0.28, 0), (0.35, 0.28, 0.6))), 42.0)
    planes = find_mirror_planes(seen.points, seen.sight, GATE)
    assert len(planes) == 2
    vertices, faces = mirrored_surface(planes, seen.points, seen.masks, seen.depths, seen.sight)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    samples = trimesh.sample.sample_surface(mesh, 2000, seed=0)[0]
    mesh = trimesh.Trimesh(seen.vertices, seen.faces, process=False)
    true = trimesh.sample.sample_surface(mesh, 30_000, seed=0)[0]
    assert np.quantile(cKDTree(true).query(samples)[0], 0.95) < 0.05
    known = cKDTree(seen.points)
    assert np.quantile(known.query(samples)[0], 0.05) > 0.025
    missing = true[(known.query(true)[0] > 0.1) & (true[:, 2] > 0.05)]
    assert len(missing) > 0.2 * len(true)
    assert (cKDTree(samples).query(missing)[0] < 0.05).mean() > 0.8


def test_two_observed_points_are_no_object():
    seen = seen_from_one_side(FURNITURE["table"](), 0.0)
    assert find_mirror_planes(seen.points[:1], seen.sight, GATE) == ()
    assert find_mirror_planes(seen.points[:0], seen.sight, GATE) == ()


@given(heading=st.floats(0, 2 * np.pi), offset=st.floats(-1, 1))
@settings(max_examples=20, deadline=None)
def test_a_mirrored_camera_sees_the_mirrored_point_in_the_flipped_picture(heading, offset):
    plane = MirrorPlane(np.array([np.cos(heading), np.sin(heading), 0]), offset, 0.0, 1.0)
    camera = Camera(64, 48, 50, 55, 30, 25, look_at((1.0, -2.0, 1.2), (0.1, 0.2, 0.4)))
    points = np.random.default_rng(0).uniform(-0.3, 0.5, (20, 3))
    np.testing.assert_allclose(plane.mirrored(plane.mirrored(points)), points, atol=1e-12)
    twin = plane.mirrored_camera(camera)
    assert np.linalg.det(twin.world_from_camera[:3, :3]) == pytest.approx(1)
    pixels, depth = camera.project(points)
    mirrored_pixels, mirrored_depth = twin.project(plane.mirrored(points))
    np.testing.assert_allclose(mirrored_depth, depth, atol=1e-9)
    np.testing.assert_allclose(mirrored_pixels, np.stack([64 - pixels[:, 0], pixels[:, 1]], 1), atol=1e-6)


def test_what_captures_see_speaks_for_and_against_points():
    seen = seen_from_one_side(FURNITURE["cupboard"](), 0.0)
    on, wrong = seen.sight.judged(seen.points)
    assert on.mean() > 0.8 and wrong.mean() < 0.05
    towards = seen.cameras[1].centre - seen.points
    before = seen.points + 0.3 * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    assert seen.sight.judged(before)[1].mean() > 0.8
    behind, wrong = seen.sight.judged(np.array([[*PLACE, 0.5]]))  # in the cupboard: hidden
    assert not behind[0] and wrong[0] == 0
