"""What sparse points around a pixel say of a surface's depth."""

import numpy as np

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.room.point_evidence import PointEvidence

CAMERA = Camera(270, 180, 233.8, 233.8, 135.0, 90.0, look_at(np.array([0.0, -2.0, 1.0]), np.array([0.0, 0.0, 1.0])))
FLAT = np.full(CAMERA.shape, 2.0, np.float32)


def test_points_on_the_surface_speak_for_it_and_others_against_it():
    evidence = PointEvidence.of(CAMERA, np.array([[-0.5, 0.0, 1.0], [0.5, -0.5, 1.0]]))  # the left one on it
    differing, sure = evidence.against(FLAT, 0.03)
    (left, right) = zip(evidence.rows, evidence.columns, strict=True)
    assert differing[left] < 0.2 and differing[right] > 0.8
    assert sure[left] > 0.8 and sure[right] > 0.8


def test_it_is_less_sure_the_farther_the_points_are():
    evidence = PointEvidence.of(CAMERA, np.array([[0.0, 0.0, 1.0]]))
    row, column = evidence.rows[0], evidence.columns[0]
    _, sure = evidence.against(FLAT, 0.03)
    along = sure[row, column:]
    assert (np.diff(along) <= 1e-6).all() and along[0] > 0.8 and along[60:].max() < 0.05


def test_where_a_surface_is_not_its_points_are_against_it():
    evidence = PointEvidence.of(CAMERA, np.array([[0.0, 0.0, 1.0]]))
    differing, _ = evidence.against(np.zeros(CAMERA.shape, np.float32), 0.03)
    assert differing[evidence.rows[0], evidence.columns[0]] == 1.0


def test_without_points_nothing_is_sure():
    differing, sure = PointEvidence.of(CAMERA, np.zeros((0, 3))).against(FLAT, 0.03)
    assert not sure.any() and np.isfinite(differing).all()


def test_points_out_of_sight_say_nothing():
    evidence = PointEvidence.of(CAMERA, np.array([[0.0, -4.0, 1.0], [50.0, 0.0, 1.0]]))
    assert not len(evidence.depth)
