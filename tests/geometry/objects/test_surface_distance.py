"""Distances from the grid against the exact ones to the triangles."""

import numpy as np
import pytest
import trimesh
from furniture import FURNITURE
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.geometry.objects.shapes import Shape


def canonical(name):
    if name == "ball":
        ball = trimesh.creation.icosphere(subdivisions=3)
        shape = Shape.of(name, ball.vertices, ball.faces)
    else:
        shape = Shape.of(name, *FURNITURE[name]())
    frame = shape.canonical_from_own
    return shape, shape.vertices @ frame[:3, :3].T + frame[:3, 3]


def exact(points, vertices, faces):
    """Brute force: every point to every triangle."""
    triangles = vertices[faces]
    found = np.full(len(points), np.inf)
    for triangle in triangles:
        corners = np.broadcast_to(triangle, (len(points), 3, 3))
        closest = trimesh.triangles.closest_point(corners, points)
        found = np.minimum(found, np.linalg.norm(closest - points, axis=1))
    return found


@pytest.fixture(scope="module", params=["chair", "cupboard", "ball"])
def shape_and_vertices(request):
    return canonical(request.param)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_distances_around_a_shape_are_nearly_exact(shape_and_vertices, seed):
    shape, vertices = shape_and_vertices
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (150, 3))
    error = np.abs(shape.surface.distances(points) - exact(points, vertices, shape.faces))
    assert error.mean() < 0.003
    assert np.quantile(error, 0.95) < 0.01
    assert error.max() < 0.04  # the step of the grid


def test_points_just_off_the_surface_do_not_see_the_samples_spacing(shape_and_vertices):
    """By far nearer than the samples are to each other."""
    shape, vertices = shape_and_vertices
    rng = np.random.default_rng(4)
    mesh = trimesh.Trimesh(vertices, shape.faces, process=False)
    points, face = trimesh.sample.sample_surface(mesh, 400, seed=5)
    points = points + rng.uniform(-0.01, 0.01, (400, 1)) * mesh.face_normals[face]
    error = np.abs(shape.surface.distances(points) - exact(points, vertices, shape.faces))
    assert np.median(error) < 5e-4
    assert np.quantile(error, 0.9) < 0.004


def test_points_beyond_the_grid_are_far(shape_and_vertices):
    shape, vertices = shape_and_vertices
    points = np.array([[3.0, 0.0, 0.0], [0.0, -40.0, 1.0]])
    found = shape.surface.distances(points)
    np.testing.assert_allclose(found, exact(points, vertices, shape.faces), rtol=0.15)


def test_the_same_mesh_gives_the_same_grid():
    for one, other in zip(canonical("chair")[0].surface, canonical("chair")[0].surface, strict=True):
        np.testing.assert_array_equal(one, other)
