"""Validity against the structural conditions' rasteriser, sample by sample."""

from dataclasses import replace

import numpy as np
import pytest
from room_meshes import grid_faces, observed_proxy

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.geometry.proxy.proxy import Provenance
from r2sego_blender.geometry.visibility.face_sight import face_sight
from r2sego_blender.views.scoring.availability import SAMPLES, ValidityRenderer

LENS = Camera(94, 67, 70.0, 72.0, 46.0, 35.5, np.eye(4))


def triangle_soup(rng, count, size):
    """Triangles of all orientations, some of them crossing each other and the cameras' planes."""
    corners = rng.uniform(-2.0, 2.0, (count, 1, 3)) + rng.normal(0.0, size, (count, 3, 3))
    faces = np.arange(3 * count).reshape(-1, 3)
    return observed_proxy(corners.reshape(-1, 3), faces, rng.integers(0, 2, count))


def wavy_surface(rng, side=70):
    """One surface around the origin without a gap, its faces sharing vertices."""
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1)
    angles = grid / (side - 1) * [np.pi, 2.0 * np.pi]
    radius = 2.0 + 0.2 * rng.random((side, 1)) * np.sin(5.0 * angles[..., 1])
    vertices = np.stack(
        [
            radius * np.sin(angles[..., 0]) * np.cos(angles[..., 1]),
            radius * np.sin(angles[..., 0]) * np.sin(angles[..., 1]),
            radius * np.cos(angles[..., 0]),
        ],
        axis=-1,
    ).reshape(-1, 3)
    return observed_proxy(vertices, grid_faces(side, side)[:, ::-1])


def cameras_inside(rng, count):
    return [LENS.at(look_at(rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0, 3))) for _ in range(count)]


def expected_shares(proxy, cameras, threshold):
    """A pixel's validity is the share of its samples that the conditions call valid."""
    renderer, shares = ZBufferRenderer(proxy), []
    for camera in cameras:
        fine = renderer.condition(camera.scaled(SAMPLES)).validity
        blocks = fine.reshape(camera.height, SAMPLES, camera.width, SAMPLES)
        shares.append((blocks.mean(axis=(1, 3)) >= threshold).mean())
    return np.array(shares)


@pytest.mark.parametrize("threshold", [0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("size", [0.05, 0.3, 3.0])
def test_validity_is_that_of_the_conditions(size, threshold):
    rng = np.random.default_rng(0)
    proxy, cameras = triangle_soup(rng, 1500, size), cameras_inside(rng, 6)
    shares = ValidityRenderer(proxy).available_shares(cameras, threshold)
    expected = expected_shares(proxy, cameras, threshold)
    assert expected.max() > 0.02
    pixels = LENS.width * LENS.height
    np.testing.assert_allclose(shares, expected, rtol=0.0, atol=2.5 / pixels)


def test_no_ray_slips_through_a_closed_surface():
    rng = np.random.default_rng(1)
    proxy, cameras = wavy_surface(rng), cameras_inside(rng, 12)
    inside = ValidityRenderer(proxy).available_shares(cameras, 1.0)
    outwards = observed_proxy(proxy.vertices, proxy.faces[:, ::-1], proxy.support)
    behind = ValidityRenderer(outwards).available_shares(cameras, 0.01)
    assert sorted({float(inside.min()), float(behind.max())}) == [0.0, 1.0]
    np.testing.assert_array_equal(inside + behind, 1.0)


def test_faces_that_no_capture_saw_are_not_available():
    rng = np.random.default_rng(2)
    proxy, cameras = wavy_surface(rng), cameras_inside(rng, 4)
    unseen = observed_proxy(proxy.vertices, proxy.faces, np.zeros(len(proxy.faces)))
    assert not ValidityRenderer(unseen).available_shares(cameras, 0.01).any()


def floor_and_sight(eye):
    """A level square around the origin, seen well where a camera at ``eye`` sees it well."""
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41), indexing="ij")
    proxy = observed_proxy(np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], -1), grid_faces(*x.shape))
    return proxy, face_sight(proxy.vertices, proxy.faces, [LENS.at(look_at(eye, (0.001, 0, 0)))])


@pytest.mark.parametrize(("share", "available"), [(0.3, True), (0.9, True), (1.2, False), (3.0, False)])
def test_a_surface_is_available_up_to_four_pixels_for_one_of_a_photograph(share, available):
    photographed_m = 4.0
    proxy, sight = floor_and_sight((0.0, 0.0, photographed_m))
    view = LENS.at(look_at((0.0, 0.0, photographed_m / (4.0 * share)), (0.001, 0, 0)))
    for scale in (1.0, 0.5):
        (found,) = ValidityRenderer(proxy, sight).available_shares([view.scaled(scale)], 0.8, scale)
        (supported,) = ValidityRenderer(proxy).available_shares([view.scaled(scale)], 0.8, scale)
        # Faces on the rim are narrower than the capture's pixels.
        assert found == pytest.approx(supported if available else 0.0, rel=0.1)


@pytest.mark.parametrize(
    ("certainty", "share", "available"), [(0.5, 0.65, True), (0.5, 0.75, False), (0.1, 0.4, False)]
)
def test_an_estimate_is_available_up_to_its_certainty_of_that(certainty, share, available):
    photographed_m = 4.0
    proxy, sight = floor_and_sight((0.0, 0.0, photographed_m))
    count = len(proxy.faces)
    proxy = replace(
        proxy,
        provenance=np.full(count, Provenance.ESTIMATED, np.uint8),
        confidence=np.full(count, certainty, np.float32),
    )
    view = LENS.at(look_at((0.0, 0.0, photographed_m / (4.0 * share)), (0.001, 0, 0)))
    (found,) = ValidityRenderer(proxy, sight).available_shares([view], 0.8)
    (supported,) = ValidityRenderer(proxy).available_shares([view], 0.8)
    assert found == pytest.approx(supported if available else 0.0, rel=0.1)


def test_a_surface_that_captures_saw_flatly_is_not_available():
    view = LENS.at(look_at((0.0, 0.0, 2.0), (0.001, 0, 0)))
    for rise_deg, some in ((30.0, True), (10.0, False)):
        rise = np.radians(rise_deg)
        proxy, sight = floor_and_sight((4.0 * np.cos(rise), 0.0, 4.0 * np.sin(rise)))
        assert (ValidityRenderer(proxy, sight).available_shares([view], 0.8)[0] > 0.3) == some


def test_the_bits_do_not_depend_on_the_threads_nor_on_the_company(with_threads):
    rng = np.random.default_rng(3)
    proxy, cameras = triangle_soup(rng, 2000, 0.3), cameras_inside(rng, 9)
    renderer = ValidityRenderer(proxy)
    together = renderer.available_shares(cameras, 0.8)
    with_one = with_threads(1, lambda: renderer.available_shares(cameras, 0.8))
    alone = [renderer.available_shares([camera], 0.8)[0] for camera in cameras]
    np.testing.assert_array_equal(with_one, together)
    np.testing.assert_array_equal(alone, together)


def test_an_empty_proxy_is_available_nowhere():
    empty = observed_proxy(np.zeros((0, 3)), np.zeros((0, 3)), [])
    assert ValidityRenderer(empty).available_shares([LENS], 0.8).tolist() == [0.0]
    assert ValidityRenderer(empty).available_shares([], 0.8).tolist() == []


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [([[0, 0, np.nan], [1, 0, 1], [0, 1, 1]], [[0, 1, 2]]), (np.eye(3), [[0, 1, 3]]), (np.eye(3), [[0, 1, -1]])],
)
def test_meshes_that_cannot_be_drawn_are_refused(vertices, faces):
    with pytest.raises(GeometryError, match="proxy"):
        ValidityRenderer(observed_proxy(vertices, faces, [1]))
