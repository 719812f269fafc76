"""A floor without features is found by how alike photographs look on it, and where they do not, none is."""

import numpy as np
import pytest
from measured_points import measured
from painted_room import LENS, paint, painted_photographs, room_mesh

from r2sego_blender.captures.frame.floor_sweep import swept_floor
from r2sego_blender.captures.frame.scale import Scale
from r2sego_blender.captures.frame.world_frame import register
from r2sego_blender.captures.importing import Imported
from r2sego_blender.config.settings import CaptureSettings
from r2sego_blender.core.cameras import look_at

UP = np.array([0.0, 0.0, 1.0])
EYE_M = 1.3
"""Lower than is usual."""


def blank_floor(points):
    return np.where(points[..., 2:] < 1e-3, 0.5, paint(points))


def photographs(folder, colour=paint):
    places = [(x, -1.3, EYE_M) for x in (-1.2, -0.6, 0.0, 0.6, 1.2)]
    cameras = [LENS.scaled(2.0).at(look_at(place, (0.4 * place[0], 0.6, 0.0))) for place in places]
    return painted_photographs(folder, room_mesh(), cameras, colour)


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    return photographs(tmp_path_factory.mktemp("shown"))


def test_the_floor_is_found_to_a_centimetre_and_twice_the_same(captures):
    found = swept_floor(captures, UP, 0.4)
    assert found.height_m == pytest.approx(0.0, abs=0.01)
    assert found.patches > 300
    assert swept_floor(captures, UP, 0.4) == found


def test_a_blank_floor_is_not_found_and_nothing_above_it_is_taken_for_one(tmp_path):
    """The box's top, 70 cm high, is the plane that most patches lie on: the top one that is tried, or one too high."""
    blank = photographs(tmp_path, blank_floor)
    assert swept_floor(blank, UP, 0.4) is None
    assert swept_floor(blank, UP, 0.71) is None


def test_one_photograph_tells_no_floor(captures):
    assert swept_floor(captures[:1], UP, 0.4) is None


def _points_above(rng, lowest_m):
    """Points of the box and the walls, none lower than ``lowest_m``."""
    box = rng.uniform([0.4, 0.5, lowest_m], [1.4, 0.5, 0.7], (200, 3))
    wall = rng.uniform([-2.0, 1.5, lowest_m], [2.0, 1.5, 2.4], (300, 3))
    return np.concatenate([box, wall])


@pytest.mark.parametrize("unit_m", [1.0, 0.25])
def test_poses_without_a_point_on_the_floor_stand_on_it(captures, rng, unit_m):
    """In whatever unit: declared poses have one, else a marker or a length does."""
    scaling = np.diag([1 / unit_m, 1 / unit_m, 1 / unit_m, 1.0])
    moved = tuple(capture.transformed(scaling) for capture in captures)
    sparse = measured(_points_above(rng, 0.2), [capture.camera for capture in captures]).transformed(scaling)
    scale = Scale() if unit_m == 1.0 else Scale("measured", metres=unit_m, whose="a marker")
    found = register(Imported(moved, "test", True), sparse, scale, CaptureSettings())
    assert "plane sweeping" in found.ground
    heights = [capture.camera.centre[2] for capture in found.captures(moved)]
    np.testing.assert_allclose(heights, EYE_M, atol=0.012)


def test_without_any_point_the_floor_is_looked_for_too(captures):
    sparse = measured(np.zeros((0, 3)), [capture.camera for capture in captures])
    found = register(Imported(captures, "test", True), sparse, Scale(), CaptureSettings())
    assert found.captures(captures)[0].camera.centre[2] == pytest.approx(EYE_M, abs=0.012)
    given = register(Imported(captures, "test", True), sparse, Scale.camera_height(1.6), CaptureSettings())
    assert given.captures(captures)[0].camera.centre[2] == pytest.approx(1.6)  # what a person measured holds
