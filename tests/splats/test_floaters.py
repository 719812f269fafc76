"""Neighbours are counted as a search through all pairs counts them, within the promised bounds."""

import numpy as np
from scipy.spatial import cKDTree

from r2sego_blender.splats.floaters import neighbours


def test_all_within_the_distance_are_counted_and_none_far_beyond():
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (3000, 3)).astype(np.float32)
    tree = cKDTree(points)
    found = neighbours(points, 0.25)
    least = tree.query_ball_point(points, 0.25 - 1e-6, return_length=True)
    most = tree.query_ball_point(points, 0.25 * 3.5, return_length=True)
    assert (found >= least).all() and (found <= most).all()


def test_one_point_has_itself():
    assert neighbours(np.array([[1e9, 0.0, -3.0]]), 0.1).tolist() == [1]
