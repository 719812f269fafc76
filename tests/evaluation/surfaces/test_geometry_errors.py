"""Distances to surfaces, and errors of depth, against brute force and what can be counted by hand."""

import numpy as np
import pytest
import trimesh
from room_meshes import plate

from r2sego_blender.core.errors import EvaluationError
from r2sego_blender.evaluation.surfaces.geometry_errors import DepthError, Surface, within


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


# ---- depth maps


def test_depth_errors_are_of_all_pixels_with_a_truth():
    true = [np.array([[1.0, 2.0, 4.0, 0.0]]), np.array([[2.0]])]
    found = [np.array([[1.04, 2.2, 0.0, 7.0]]), np.array([[2.0]])]
    error = DepthError.of(found, true)
    assert error.median == pytest.approx((0.04 + 0.1) / 2) and error.right == pytest.approx(2 / 4)
    assert error.right == within(found, true, 0.05)
    assert DepthError.of(found[:1], [np.zeros((1, 4))]) is None and DepthError.of([], []) is None


# ---- surfaces


def test_distances_equal_brute_force():
    generator = np.random.default_rng(7)
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.4)
    mesh = trimesh.util.concatenate([mesh, trimesh.Trimesh(*plate(2.0, 1.0, -0.5), process=False)])
    points = generator.uniform(-1.0, 1.5, (400, 3))
    surface = Surface(mesh.vertices, mesh.faces, 50_000, rng())
    distance, face = surface.nearest(points)
    triangles = np.asarray(mesh.triangles)
    exact = 0
    for point, found, one in zip(points, distance, face, strict=True):
        everywhere = np.repeat(point[None], len(triangles), axis=0)
        closest = trimesh.triangles.closest_point(triangles, everywhere)
        apart = np.linalg.norm(closest - point, axis=1)
        assert apart.min() - 1e-12 <= found <= apart.min() + 0.03  # samples lie 1 cm apart
        assert apart[one] == pytest.approx(found, abs=1e-12)
        exact += found <= apart.min() + 1e-9
    assert exact > 0.98 * len(points)


def test_few_large_and_many_tiny_faces_are_both_found():
    large = plate(10.0, 10.0)
    tiny = trimesh.creation.icosphere(subdivisions=1, radius=0.001)
    tiny.apply_translation((5.0, 5.0, 3.0))
    mesh = trimesh.util.concatenate([trimesh.Trimesh(*large, process=False), tiny])
    surface = Surface(mesh.vertices, mesh.faces, 20_000, rng())
    assert surface.distance(np.array([[5.0, 5.0, 3.01]]))[0] == pytest.approx(0.009, abs=3e-4)
    assert surface.distance(np.array([[5.0, 5.0, 1.0]]))[0] == pytest.approx(1.0)


def test_faces_without_area_disturb_nothing():
    vertices, faces = plate(1.0, 1.0)
    faces = np.concatenate([faces, [[0, 0, 1], [2, 2, 2]]])
    distance = Surface(vertices, faces, 100, rng()).distance(np.array([[0.0, 0.0, 0.2], [1.0, 1.0, 0.0]]))
    np.testing.assert_allclose(distance, [0.2, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    "mesh",
    [
        (np.zeros((3, 3)), np.array([[0, 1, 2]])),
        (np.zeros((0, 3)), np.zeros((0, 3), int)),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]])),
    ],
)
def test_a_surface_without_area_is_refused(mesh):
    with pytest.raises(EvaluationError, match="without area"):
        Surface(*mesh, 10, rng())
