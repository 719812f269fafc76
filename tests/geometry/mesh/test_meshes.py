"""Normals, areas and merged vertices, against solids and means that are known."""

import numpy as np
import trimesh

from r2sego_blender.geometry.mesh.meshes import merged, normals_and_areas, places


def test_normals_and_areas_are_those_of_a_sphere_of_triangles():
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.7)
    normals, areas = normals_and_areas(mesh.vertices.astype(np.float32), mesh.faces)
    outwards = mesh.triangles_center / np.linalg.norm(mesh.triangles_center, axis=1, keepdims=True)
    assert ((normals * outwards).sum(1) > 0.999).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(areas, mesh.area_faces, rtol=1e-5)


def test_a_face_without_area_has_no_normal():
    normals, areas = normals_and_areas(np.eye(3)[[0, 0, 1]], np.array([[0, 1, 2]]))
    assert (normals == 0).all() and (areas == 0).all()


def test_vertices_of_a_cell_become_their_mean():
    rng = np.random.default_rng(4)
    vertices = rng.normal(size=(200, 3))
    cells = np.floor(vertices).astype(np.int64)
    means, became = merged(vertices, cells)
    assert len(means) == len(np.unique(cells, axis=0))
    for k in range(len(means)):
        same = (cells == cells[became == k][0]).all(1)
        np.testing.assert_array_equal(same, became == k)
        np.testing.assert_allclose(means[k], vertices[same].mean(0), atol=1e-12)


def test_vertices_a_hair_apart_are_one_place_and_a_millimetre_apart_two():
    rng = np.random.default_rng(5)
    vertices = rng.integers(-5000, 5000, (300, 3)) * 1e-3
    near = vertices + rng.uniform(-4e-5, 4e-5, vertices.shape)
    np.testing.assert_array_equal(places(near), places(vertices))
    assert (places(vertices + np.array([0.0, 1e-3, 0.0])) != places(vertices)).any(axis=1).all()
