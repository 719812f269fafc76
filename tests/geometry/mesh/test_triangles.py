"""Questions to triangles in space, against plain ones asked of each triangle in turn."""

import numpy as np
import pytest
import trimesh

from r2sego_blender.geometry.mesh.triangles import columns, crossed, distances


@pytest.fixture(scope="module")
def triangles() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(300, 1, 3)) + np.random.default_rng(1).normal(size=(300, 3, 3)) * 0.3


def test_distances_are_those_to_the_nearest_of_all_triangles(triangles):
    points = np.random.default_rng(2).normal(size=(200, 3)) * 1.5
    everywhere = np.array(
        [
            np.linalg.norm(trimesh.triangles.closest_point(triangles, np.tile(p, (300, 1))) - p, axis=1).min()
            for p in points
        ]
    )
    found = distances(triangles, points, 0.5)
    near = everywhere <= 0.5
    assert 20 < near.sum() < 200
    np.testing.assert_allclose(found[near], everywhere[near], atol=1e-12)
    assert np.isinf(found[~near]).all()
    assert np.isinf(distances(triangles, np.full((1, 3), np.nan), 0.5)).all()


def test_a_column_through_a_box_meets_its_lower_and_upper_side():
    box = trimesh.creation.box((1, 1, 0.5))
    places = np.array([[0.1, 0.2], [-0.4, 0.3], [0.6, 0.0]])
    (heights, upward), (other, _), (none, _) = columns(np.asarray(box.triangles), places)
    np.testing.assert_allclose(heights, (-0.25, 0.25), atol=1e-12)
    assert upward.tolist() == [False, True]
    np.testing.assert_allclose(other, (-0.25, 0.25), atol=1e-12)
    assert len(none) == 0


def test_a_column_meets_sloping_triangles_where_their_planes_are():
    """On a sphere of 20,000 faces, at the height the circle's equation gives."""
    ball = trimesh.creation.icosphere(5, 1.0)
    places = np.random.default_rng(3).uniform(-0.6, 0.6, (50, 2))
    for place, (heights, upward) in zip(places, columns(np.asarray(ball.triangles), places), strict=True):
        height = np.sqrt(1 - place @ place)
        np.testing.assert_allclose(heights, (-height, height), atol=2e-3)
        assert upward.tolist() == [False, True]


def test_a_path_crosses_a_surface_only_from_its_front():
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    down = np.array([[0.3, 0.4, 1.0], [0.3, 0.4, 0.2], [0.35, 0.45, -0.5]])
    beside, stops = down + np.array([2, 0, 0]), down[:2]
    broken = np.array([[0.3, 0.4, 1.0], [np.nan, 0, 0], [0.3, 0.4, -1.0]])
    for path, crosses in ((down, True), (down[::-1], False), (beside, False), (stops, False), (broken, False)):
        assert crossed(square, path[None]).tolist() == [crosses]


def test_long_paths_are_asked_in_all_their_parts(triangles):
    """A random walk crosses what its single segments cross."""
    walks = np.random.default_rng(4).normal(size=(40, 60, 3)).cumsum(1) * 0.015
    segments = np.stack([walks[:, :-1], walks[:, 1:]], 2)
    each = [crossed(triangles, walk).any() for walk in segments]
    assert crossed(triangles, walks).tolist() == each
    assert 0 < sum(each) < 40
