"""Small holes are closed, large ones and small parts stay as they are."""

import numpy as np
import trimesh

from r2sego_blender.geometry.mesh.small_holes import small_holes_closed


def _ball_without(*centres, radius_m: float) -> trimesh.Trimesh:
    """A ball of radius 1 m with a hole around each of the ``centres``."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    away = [np.linalg.norm(ball.triangles_center - centre, axis=1) > radius_m for centre in centres]
    ball.update_faces(np.all(away, axis=0))
    return ball


def _closed(mesh: trimesh.Trimesh, longest_rim_m: float) -> trimesh.Trimesh:
    closed = small_holes_closed(np.asarray(mesh.vertices), np.asarray(mesh.faces), longest_rim_m)
    return trimesh.Trimesh(*closed, process=False)


def test_a_small_hole_is_closed_facing_as_its_neighbours_do():
    ball = _ball_without((0, 0, 1), (1, 0, 0), radius_m=0.1)
    assert not ball.is_watertight
    closed = _closed(ball, 1.5)
    assert closed.is_watertight and closed.is_winding_consistent
    np.testing.assert_array_equal(closed.faces[: len(ball.faces)], ball.faces)
    assert closed.volume > 0.999 * trimesh.creation.icosphere(subdivisions=4).volume


def test_a_hole_with_a_longer_rim_stays_open():
    ball = _ball_without((0, 0, 1), radius_m=0.5)
    closed = _closed(ball, 2.0)  # its rim, in a zigzag, is 2 pi 0.48 m and more
    np.testing.assert_array_equal(closed.faces, ball.faces)
    assert _closed(ball, 6.0).is_watertight


def test_the_outline_of_a_small_part_is_no_hole():
    sheet = trimesh.Trimesh([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)], [(0, 1, 2), (0, 2, 3)])
    both = trimesh.util.concatenate([_ball_without((0, 0, 1), radius_m=0.1), sheet])
    added = len(_closed(both, 1.5).faces) - len(both.faces)
    assert added == len(_closed(_ball_without((0, 0, 1), radius_m=0.1), 1.5).faces) - len(both.faces) + 2


def test_a_closed_surface_is_returned_as_it_is():
    ball = trimesh.creation.icosphere(subdivisions=2)
    closed = _closed(ball, 10.0)
    np.testing.assert_array_equal(closed.faces, ball.faces)
    np.testing.assert_array_equal(closed.vertices, ball.vertices)
