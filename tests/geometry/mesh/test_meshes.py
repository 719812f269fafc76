"""Normals, areas, parts and merged vertices, against solids, means and trimesh."""

import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.geometry.mesh.meshes import compacted, connected, merged, normals_and_areas, places


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


@given(st.integers(0, 2**32 - 1), st.integers(0, 60))
def test_compacted_is_the_same_surface_without_the_vertices_of_no_face(seed, count):
    rng = np.random.default_rng(seed)
    vertices, faces = rng.normal(size=(90, 3)), rng.integers(0, 90, (count, 3))
    kept, renumbered = compacted(vertices, faces)
    np.testing.assert_array_equal(kept, vertices[np.unique(faces)])
    assert renumbered.dtype == np.int32 and renumbered.shape == faces.shape
    np.testing.assert_array_equal(kept[renumbered], vertices[faces])


@given(st.integers(0, 2**32 - 1), st.integers(0, 60), st.sampled_from([2, 3]))
def test_connected_parts_are_those_of_trimesh_and_numbered_by_their_first_vertices(seed, count, corners):
    faces = np.random.default_rng(seed).integers(0, 90, (count, corners))
    found = connected(faces, 90)
    edges = np.concatenate([faces[:, [k, k + 1]] for k in range(corners - 1)])
    np.testing.assert_array_equal(found, trimesh.graph.connected_component_labels(edges, 90))
    first = np.unique(found, return_index=True)[1]
    assert (np.diff(first) > 0).all() and found.max() + 1 == len(first)


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
