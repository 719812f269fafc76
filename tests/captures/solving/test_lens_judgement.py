"""A wrong lens is found from tracks between nearly right poses, and a right one left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_tracks import LENS, arc, measured
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.solving.lens_judgement import judged_lenses, lens_groups

SIGMAS = 0.01, np.radians(0.3)


def _disturbed(cameras, rng):
    """As the priors say, or half of it."""
    poses = []
    for camera in cameras:
        pose = camera.world_from_camera.copy()
        pose[:3, :3] = Rotation.from_rotvec(rng.normal(0, SIGMAS[1] / 2, 3)).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += rng.normal(0, SIGMAS[0] / 2, 3)
        poses.append(camera.at(pose))
    return poses


@pytest.mark.parametrize("factor", [0.85, 0.95, 1.05, 1.15])
def test_a_wrong_focal_length_is_found(factor, rng):
    cameras = arc(8)
    _, pixels = measured(cameras, rng)
    given = [replace(c, fx=c.fx * factor, fy=c.fy * factor) for c in _disturbed(cameras, rng)]
    found = judged_lenses(given, pixels, *SIGMAS, factor=1.0, fewest=100)
    assert found.determined
    assert np.exp(found.terms[0, 0]) * factor == pytest.approx(1.0, abs=0.01)
    assert not found.terms[0, 1:].any()
    assert found.lenses_px < 0.35 < found.given_px


def test_a_shifted_principal_point_is_found(rng):
    cameras = arc(8)
    _, pixels = measured(cameras, rng)
    given = [replace(c, cx=c.cx + 19.0, cy=c.cy - 14.0) for c in _disturbed(cameras, rng)]
    found = judged_lenses(given, pixels, *SIGMAS, factor=1.0, fewest=100)
    assert found.determined
    np.testing.assert_allclose(found.terms[0, 1:3] * LENS.fx, [-19.0, 14.0], atol=2.0)
    assert abs(found.terms[0, 0]) < 0.01 and not found.terms[0, 3:].any()


def test_a_distortion_that_was_left_out_is_found(rng):
    cameras = arc(8)
    _, pixels = measured(cameras, rng, distortion=(-0.1, 0.0))
    found = judged_lenses(_disturbed(cameras, rng), pixels, *SIGMAS, factor=1.0, fewest=100)
    assert found.determined
    radius2 = 0.5**2
    assert radius2 * (found.terms[0, 3] + radius2 * found.terms[0, 4]) == pytest.approx(-0.1 * radius2, abs=0.004)
    assert found.lenses_px < 0.3


@pytest.mark.parametrize("seed", range(3))
def test_a_right_lens_is_left_alone(seed):
    rng = np.random.default_rng(seed)
    cameras = arc(8)
    _, pixels = measured(cameras, rng)
    assert judged_lenses(cameras, pixels, *SIGMAS, factor=1.0, fewest=100) is None
    assert judged_lenses(_disturbed(cameras, rng), pixels, *SIGMAS, factor=1.0, fewest=100) is None
    assert judged_lenses(cameras, pixels[:99], *SIGMAS, factor=1.0, fewest=100) is None


def test_each_group_has_a_lens_of_its_own(rng):
    """Two lenses, one of them stated wrongly."""
    zoomed = replace(LENS, fx=520.0, fy=520.0)
    cameras = [replace(c, fx=520.0, fy=520.0) if index % 2 else c for index, c in enumerate(arc(10))]
    _, pixels = measured(cameras, rng, count=900)
    given = [replace(c, fx=572.0, fy=572.0) if c.fx == zoomed.fx else c for c in cameras]
    np.testing.assert_array_equal(lens_groups(given), [0, 1] * 5)
    found = judged_lenses(given, pixels, *SIGMAS, factor=1.0, fewest=100)
    np.testing.assert_allclose(np.exp(found.terms[:, 0]), [1.0, 520.0 / 572.0], rtol=0.006)


def test_phones_state_slightly_different_intrinsics_for_each_photograph():
    cameras = [replace(LENS, fx=LENS.fx * (1 + 0.002 * k), cx=LENS.cx + k) for k in range(5)]
    assert lens_groups(cameras).max() == 0
    assert lens_groups([*cameras, replace(LENS, width=480, height=640)]).max() == 1
