"""The fit of a shape placed by hand: silhouettes of samples against masks, quick enough to follow."""

import time

import fake_bundle
import fake_proxy
import numpy as np
import pytest

from r2sego_blender.geometry.visibility.rasterizer import MeshRasterizer
from r2sego_blender.results.panels.placement import fit_of, mask_window, outline, silhouette, surface_samples


def world(shift=(0.0, 0.0, 0.0)):
    vertices, faces = fake_proxy.crate()
    pose = fake_proxy.CRATE_FROM_OWN
    return vertices @ pose[:3, :3].T + pose[:3, 3] + shift, faces


@pytest.fixture(scope="module")
def cameras():
    return [camera.scaled(4.0) for camera in fake_bundle.cameras()]


def windows_of(cameras, depth=None):
    drawn = [MeshRasterizer(*world()).render(camera).depth for camera in cameras]
    return [mask_window(str(k), c, d > 0, depth) for k, (c, d) in enumerate(zip(cameras, drawn, strict=True))]


def test_samples_lie_evenly_on_the_surface():
    vertices, faces = fake_proxy.crate()
    points = surface_samples(vertices, faces, 6000)
    assert np.abs(np.abs(points).max(1) - 1.0).max() < 1e-6
    on_sides = [(points[:, axis] * sign > 0.999999).sum() for axis in range(3) for sign in (-1, 1)]
    assert max(on_sides) - min(on_sides) < 20
    np.testing.assert_array_equal(points, surface_samples(vertices, faces, 6000))


def test_a_silhouette_of_samples_is_the_drawn_one(cameras):
    for camera in cameras:
        small = camera.fitted(80)
        exact = MeshRasterizer(*world()).render(small).depth
        found = silhouette(small, surface_samples(*world()))
        assert ((found > 0) & (exact > 0)).sum() / ((found > 0) | (exact > 0)).sum() > 0.93
        both = (found > 0) & (exact > 0)
        assert np.median(np.abs(found - exact)[both]) < 0.05


@pytest.mark.parametrize("shift_m", [0.0, 0.05, 0.15, 0.4])
def test_the_overlap_is_that_of_drawn_faces(cameras, shift_m):
    windows = windows_of(cameras)
    vertices, faces = world((shift_m, 0.0, 0.0))
    found = fit_of(windows, surface_samples(vertices, faces))
    exact = []
    for window in windows:
        drawn = MeshRasterizer(vertices, faces).render(window.camera).depth > 0
        exact.append((drawn & window.mask).sum() / (drawn | window.mask).sum())
    assert found.iou == pytest.approx(np.mean(exact), abs=0.04)
    assert len(found.ious) == 3


def test_what_something_nearer_hides_does_not_count(cameras):
    (camera,) = cameras[:1]
    mask = MeshRasterizer(*world()).render(camera).depth > 0
    half = mask.copy()
    half[:, np.flatnonzero(mask.any(0))[mask.any(0).sum() // 2] :] = False
    near = np.where(mask & ~half, np.float32(0.3), np.float32(0.0))
    points = surface_samples(*world())
    (seen,), (hidden,) = (fit_of([mask_window("a", camera, half, depth)], points).ious for depth in (None, near))
    assert seen < 0.7 and hidden > 0.9


def test_a_window_shows_the_masks_surroundings_at_their_place(cameras):
    camera = cameras[1]
    mask = np.zeros(camera.shape, bool)
    mask[60:120, 100:180] = True
    window = mask_window("a", camera, mask)
    assert max(window.mask.shape) <= 72
    assert 0.15 < window.mask.mean() < 0.35
    point = camera.world_from_camera[:3, 3] + camera.forward * 2
    (x, y), _ = camera.project(point)
    (u, v), _ = window.camera.project(point)
    left, top = 100 - 2 - 40, 60 - 2 - 30
    assert u == pytest.approx((x - left) * window.camera.fx / camera.fx, abs=0.51)
    assert v == pytest.approx((y - top) * window.camera.fy / camera.fy, abs=0.51)
    assert mask_window("a", camera, np.zeros(camera.shape, bool)) is None


def test_an_outline_goes_around_its_region():
    region = np.zeros((5, 6), bool)
    region[1:3, 2:5] = True
    segments = outline(region).reshape(-1, 2, 2)
    assert len(segments) == 2 * (2 + 3)
    np.testing.assert_allclose(np.abs(segments[:, 0] - segments[:, 1]).sum(1), 1.0)
    np.testing.assert_array_equal(segments.reshape(-1, 2).min(0), [2, 1])
    np.testing.assert_array_equal(segments.reshape(-1, 2).max(0), [5, 3])
    whole = outline(np.ones((2, 2), bool)).reshape(-1, 2, 2)
    assert len(whole) == 8
    assert len(outline(np.zeros((2, 2), bool))) == 0


def test_twelve_captures_are_rated_within_a_frame(cameras):
    windows = windows_of(cameras) * 4
    points = surface_samples(*world())
    fit_of(windows, points)
    started_s = time.process_time()
    for _ in range(5):
        fit_of(windows, points)
    assert (time.process_time() - started_s) / 5 < 0.5
