"""How far points stand out of a surface, beside the exact distance to boxes and spheres."""

import numpy as np
import pytest
import trimesh

from r2sego_blender.geometry.collision.convex import Soup
from r2sego_blender.geometry.collision.protrusion import FreeSide, parts_by_area, parts_by_side, sampled


def free_side(mesh: trimesh.Trimesh, floored: bool = False) -> FreeSide:
    soup = Soup.of(mesh.vertices, mesh.faces)
    return FreeSide.of(soup.corners, soup.normals, floored)


@pytest.fixture(scope="module")
def box() -> FreeSide:
    return free_side(trimesh.creation.box((1.0, 0.8, 0.6)))


def signed_distance(points: np.ndarray) -> np.ndarray:
    away = np.abs(points) - (0.5, 0.4, 0.3)
    return np.linalg.norm(np.maximum(away, 0), axis=1) + np.minimum(away.max(1), 0)


def test_points_stand_out_of_a_box_by_their_distance(box):
    """Near its sides to the millimetre; past its edges and far away to the samples' spacing."""
    points = np.random.default_rng(0).uniform(-0.9, 0.9, (5000, 3))
    exact, found = signed_distance(points), box.standing_out(points)
    clear = np.abs(exact) > 0.02
    assert (np.sign(found[clear]) == np.sign(exact[clear])).all()
    assert np.abs(found - exact)[clear].max() < 0.03
    beside_a_side = (np.abs(points) < np.array([0.5, 0.4, 0.3]) - 0.07).sum(1) == 2
    near = beside_a_side & (exact > 0) & (exact < 0.06)
    assert near.sum() > 50
    np.testing.assert_allclose(found[near], exact[near], atol=1e-9)


def test_the_floor_counts_as_a_surface():
    high = trimesh.creation.box((1, 1, 1))
    high.apply_translation((0, 0, 3))
    points = np.array([[0, 0, 0.03], [5, 5, 0.2], [0, 0, -0.1]])
    np.testing.assert_allclose(free_side(high, floored=True).standing_out(points), points[:, 2])
    assert (free_side(high).standing_out(points) > 2.0).all()


def test_a_huge_surface_gets_larger_cells_not_more_memory():
    far = trimesh.creation.box((1, 1, 1))
    far.apply_translation((3000, 2000, 100))
    both = trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), far])
    side = free_side(both)
    assert side.shape.prod() < 1e8
    np.testing.assert_allclose(side.standing_out(np.array([[0, 0, 0.55], [3000, 2000, 99.0]])), (0.05, 0.5))


def test_samples_lie_on_their_triangles_evenly():
    corners = np.random.default_rng(1).normal(size=(20, 3, 3))
    points, triangle = sampled(corners, parts_by_side(corners, 0.1))
    closest = trimesh.triangles.closest_point(corners[triangle], points)
    np.testing.assert_allclose(points, closest, atol=1e-9)
    for index in range(20):
        np.testing.assert_allclose(points[triangle == index].mean(0), corners[index].mean(0), atol=1e-9)


def test_slivers_get_few_points_by_area():
    sliver = np.array([[[0, 0, 0], [1, 0, 0], [1, 1e-3, 0]]])
    assert parts_by_area(np.array([1e-3]), 0.04).tolist() == [1]
    assert parts_by_side(sliver, 0.04).tolist() == [26]
