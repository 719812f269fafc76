"""Poses disturbed by what their priors say come back, in the frame they were given in."""

from __future__ import annotations

import numpy as np
import pytest
from measured_tracks import arc
from scipy.spatial.transform import Rotation

from r2sego_blender.captures.solving import bundle_adjustment
from r2sego_blender.captures.solving.bundle_adjustment import LENS_TERMS, adjusted, adjusted_lenses, reprojection_errors
from r2sego_blender.core.cameras import Camera, look_at

SIGMA_M, SIGMA_RAD = 0.01, np.radians(0.3)
LENS = Camera(640, 480, 381.0, 379.0, 322.0, 239.0, np.eye(4))


def _disturbed(cameras, rng, sigma_m=SIGMA_M, sigma_rad=SIGMA_RAD) -> list[Camera]:
    poses = []
    for camera in cameras:
        pose = camera.world_from_camera.copy()
        pose[:3, :3] = Rotation.from_rotvec(rng.normal(0, sigma_rad, 3)).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += rng.normal(0, sigma_m, 3)
        poses.append(camera.at(pose))
    return poses


def _tracks(cameras, rng, count=600, noise_px=0.3) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3) and their measurements (P, N, 2), each point's by two cameras at least."""
    points = rng.uniform((-2, -1, 0), (2, 3, 2.6), (count, 3))
    pixels = np.full((count, len(cameras), 2), np.nan)
    for index, camera in enumerate(cameras):
        places, depth = camera.project(points)
        seen = camera.sees(places, depth) & (rng.random(count) < 0.6)
        pixels[seen, index] = places[seen] + rng.normal(0, noise_px, (seen.sum(), 2))
    kept = np.isfinite(pixels[..., 0]).sum(axis=1) >= 2
    return points[kept], pixels[kept]


def _centres(cameras) -> np.ndarray:
    return np.array([camera.centre for camera in cameras])


def _turns_rad(cameras, others) -> np.ndarray:
    """(N, 3) what turns each camera into its other one, about the world's axes."""
    a, b = (np.array([c.world_from_camera[:3, :3] for c in some]) for some in (cameras, others))
    return Rotation.from_matrix(b @ a.transpose(0, 2, 1)).as_rotvec()


def _apart(cameras, others) -> tuple[np.ndarray, np.ndarray]:
    """Metres and degrees between two sets of cameras, after the similarity that takes one to the other."""
    turn = Rotation.from_rotvec(_turns_rad(cameras, others)).mean()
    turns = np.linalg.norm(
        [(Rotation.from_rotvec(t) * turn.inv()).as_rotvec() for t in _turns_rad(cameras, others)], axis=1
    )
    a, b = (_centres(some) - _centres(some).mean(axis=0) for some in (cameras, others))
    a = turn.apply(a)
    a *= (a * b).sum() / (a * a).sum()
    return np.linalg.norm(a - b, axis=1), np.degrees(turns)


def _adjusted(given, points, pixels, rng):
    start = points + rng.normal(0, 0.02, points.shape)
    return adjusted(given, start, pixels, SIGMA_M, SIGMA_RAD)


@pytest.mark.parametrize("count", [3, 6, 30])
def test_poses_come_back(count, rng):
    true = arc(count, LENS)
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    cameras, found = _adjusted(given, points, pixels, rng)
    (was_m, was_deg), (is_m, is_deg) = _apart(given, true), _apart(cameras, true)
    assert is_m.mean() < 0.25 * was_m.mean() and is_deg.mean() < 0.15 * was_deg.mean()
    assert is_deg.max() < 0.06
    assert np.median(reprojection_errors(cameras, found, pixels)) < 0.45


def test_the_given_frame_and_scale_are_kept(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    cameras, _ = _adjusted(given, points, pixels, rng)
    before, after = _centres(given), _centres(cameras)
    assert np.linalg.norm(after - before, axis=1).max() > 0.003
    np.testing.assert_allclose(after.mean(axis=0), before.mean(axis=0), atol=1e-9)
    a, b = after - after.mean(axis=0), before - before.mean(axis=0)
    assert (a * b).sum() / (a * a).sum() == pytest.approx(1.0, abs=1e-7)
    # No rotation of the whole would bring it nearer to the given poses, centres and turns together.
    lever = np.cross(after, after - before).sum(axis=0) / SIGMA_M**2
    turn = _turns_rad(given, cameras).sum(axis=0) / SIGMA_RAD**2
    one_deviation = np.sqrt(6) / SIGMA_RAD
    np.testing.assert_allclose((lever + turn) / one_deviation, 0.0, atol=1e-4)


def test_a_frame_far_from_the_origin_and_another_unit_change_nothing(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    cameras, found = adjusted(given, points, pixels, SIGMA_M, SIGMA_RAD)
    moved = np.eye(4)
    moved[:3, :3] = 7.0 * Rotation.from_rotvec((0.4, -1.0, 0.3)).as_matrix()
    moved[:3, 3] = 300.0, -500.0, 40.0
    elsewhere, found_there = adjusted(
        [camera.transformed(moved) for camera in given],
        points @ moved[:3, :3].T + moved[:3, 3],
        pixels,
        7.0 * SIGMA_M,
        SIGMA_RAD,
    )
    for here, there in zip(cameras, elsewhere, strict=True):
        np.testing.assert_allclose(here.transformed(moved).world_from_camera, there.world_from_camera, atol=1e-4)
    off = found @ moved[:3, :3].T + moved[:3, 3] - found_there
    assert np.median(np.abs(off)) < 1e-4


def test_wrong_matches_are_outvoted(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng)
    wrong = np.isfinite(pixels[..., 0]) & (rng.random(pixels.shape[:2]) < 0.15)
    pixels[wrong] += rng.uniform(-9, 9, (wrong.sum(), 2))
    given = _disturbed(true, rng)
    cameras, found = _adjusted(given, points, pixels, rng)
    is_m, is_deg = _apart(cameras, true)
    assert is_m.max() < 0.006 and is_deg.max() < 0.06
    # A point some wrong match belongs to cannot be right; those of right ones alone are.
    clean = ~wrong.any(axis=1)
    errors = reprojection_errors(cameras, found[clean], pixels[clean])
    assert np.quantile(errors, 0.9) < 1.0


def test_a_camera_without_tracks_stays_and_one_with_few_does_not_leave(rng):
    true = arc(7, LENS)
    points, pixels = _tracks(true, rng)
    pixels[:, 6] = np.nan
    few = np.flatnonzero(np.isfinite(pixels[:, 5, 0]))[3:]
    pixels[few, 5] = np.nan
    kept = np.isfinite(pixels[..., 0]).sum(axis=1) >= 2
    given = _disturbed(true, rng)
    cameras, _ = _adjusted(given, points[kept], pixels[kept], rng)
    np.testing.assert_array_equal(cameras[6].world_from_camera, given[6].world_from_camera)
    assert np.linalg.norm(cameras[5].centre - given[5].centre) < 2 * SIGMA_M
    assert np.linalg.norm(_turns_rad(given, cameras)[5]) < 2 * SIGMA_RAD
    assert _apart(cameras[:5], true[:5])[1].max() < 0.06


def test_right_poses_hardly_move_and_the_lens_stays(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng, noise_px=0.0)
    cameras, found = adjusted(true, points, pixels, SIGMA_M, SIGMA_RAD)
    for before, after in zip(true, cameras, strict=True):
        np.testing.assert_allclose(after.world_from_camera, before.world_from_camera, atol=1e-9)
        assert (after.width, after.fx, after.fy, after.cy) == (640, 381.0, 379.0, 239.0)
        rotation = after.world_from_camera[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found, points, atol=1e-7)


def test_cameras_along_a_line_are_not_turned_about_it(rng):
    true = [LENS.at(look_at((x, -3.0, 1.5), (x, 1.0, 1.0))) for x in np.linspace(-1, 1, 5)]
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    cameras, _ = _adjusted(given, points, pixels, rng)
    common = _turns_rad(true, cameras).mean(axis=0)
    assert np.abs(common).max() < 2 * SIGMA_RAD / np.sqrt(5)


def test_points_behind_cameras_and_at_infinity_do_no_harm(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    start = points + rng.normal(0, 0.02, points.shape)
    start[0] = given[0].centre - 2.0 * given[0].forward
    start[1] = given[0].centre
    start[2] = 1e7 * given[0].forward
    cameras, found = adjusted(given, start, pixels, SIGMA_M, SIGMA_RAD)
    assert np.isfinite(found).all()
    assert _apart(cameras, true)[1].max() < 0.06


def test_the_same_tracks_give_the_same_bits(rng):
    true = arc(6, LENS)
    points, pixels = _tracks(true, rng)
    given = _disturbed(true, rng)
    (first, p), (second, q) = (adjusted(given, points, pixels, SIGMA_M, SIGMA_RAD) for _ in range(2))
    assert np.array_equal(p, q)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.world_from_camera, b.world_from_camera)


def test_terms_of_lenses_come_back_with_their_uncertainty(rng):
    """Five terms of two lenses at once, from wrong ones."""
    cameras = arc(8, LENS)
    points, _ = _tracks(cameras, rng)
    group = np.arange(8) % 2
    terms = np.array([[0.06, 0.02, -0.015, -0.08, 0.02], [-0.04, -0.01, 0.02, 0.05, -0.01]])
    pixels = np.full((len(points), 8, 2), np.nan)
    for index, camera in enumerate(cameras):
        zoom, right, down, k1, k2 = terms[group[index]]
        local = points @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
        rays = local[:, :2] / local[:, 2:]
        squares = (rays**2).sum(axis=1, keepdims=True)
        bent = rays * (1.0 + squares * (k1 + squares * k2)) * np.exp(zoom) + [right, down]
        seen = camera.sees(*camera.project(points))
        pixels[seen, index] = (bent * [camera.fx, camera.fy] + [camera.cx, camera.cy])[seen]
    free = np.ones((2, LENS_TERMS), bool)
    given = _disturbed(cameras, rng, SIGMA_M / 3, SIGMA_RAD / 3)
    found = adjusted_lenses(given, points, pixels, SIGMA_M, SIGMA_RAD, group, free, np.zeros((2, LENS_TERMS)))
    assert (np.abs(found.terms - terms) < 3.0 * found.sigma).all()
    assert (found.sigma[:, 0] < 0.01).all()
    np.testing.assert_allclose(found.terms[:, 0], terms[:, 0], atol=0.004)
    assert np.median(found.errors_px) < 0.02


def test_terms_that_are_not_free_stay_and_without_any_it_is_the_adjustment_of_poses(rng):
    cameras = arc(5, LENS)
    given = _disturbed(cameras, rng)
    points, pixels = _tracks(cameras, rng)
    none = np.zeros((1, LENS_TERMS), bool)
    alone, _ = adjusted(given, points, pixels, SIGMA_M, SIGMA_RAD)
    found = adjusted_lenses(given, points, pixels, SIGMA_M, SIGMA_RAD, np.zeros(5, int), none, none * 1.0)
    assert not found.terms.any() and not found.sigma.any()
    for a, b in zip(alone, found.cameras, strict=True):
        np.testing.assert_allclose(a.world_from_camera, b.world_from_camera, atol=1e-4)


def test_a_variance_that_rounding_left_negative_is_of_a_term_of_which_nothing_is_known(rng, monkeypatch):
    """As where a wrong lens puts points far behind each other."""
    cameras = arc(3, LENS)
    points, pixels = _tracks(cameras, rng, count=100)
    variances = np.diag([*np.ones(6 * len(cameras)), 0.04, -1e-3, np.nan])
    monkeypatch.setattr(bundle_adjustment._System, "covariance", lambda system: variances)
    free = np.array([[True, False, True, True, False]])
    group, terms = np.zeros(len(cameras), int), np.zeros((1, LENS_TERMS))
    with np.errstate(all="raise"):
        found = adjusted_lenses(cameras, points, pixels, SIGMA_M, SIGMA_RAD, group, free, terms)
    np.testing.assert_array_equal(found.sigma, [[0.2, 0.0, np.inf, np.inf, 0.0]])
