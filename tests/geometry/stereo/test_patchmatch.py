"""The PatchMatch kernels against plain references on random inputs."""

from __future__ import annotations

import numpy as np
import pytest

from r2sego_blender.core.cameras import Camera, look_at
from r2sego_blender.geometry.stereo.stereo import matching, patchmatch

LENS = (70.0, 72.0, 30.5, 24.0)


def camera(x: float, y: float = 0.0) -> Camera:
    pose = look_at(np.array([x, y, 1.0]), np.array([0.0, 3.0, 1.2]))
    return Camera(64, 48, *LENS, pose)


def transfer(a: Camera, b: Camera) -> np.ndarray:
    relative = b.camera_from_world @ a.world_from_camera
    infinite = b.matrix @ relative[:3, :3] @ np.linalg.inv(a.matrix)
    return np.column_stack([infinite, b.matrix @ relative[:3, 3]])


def random_pair():
    """Two cameras, their grey images, a reference, its sources and a field of planes."""
    rng = np.random.default_rng(7)
    a, b = camera(0.0), camera(0.3, 0.1)
    greys = [rng.integers(0, 256, (48, 64)).astype(np.float32) / 255 for _ in range(2)]
    opponent = rng.integers(-40, 41, (2, 48, 64)).astype(np.float32) / 255
    reference = matching.Reference(greys[0], opponent, np.array([*LENS, 1 / 8, 1 / 0.5], np.float32))
    sources = matching.Sources(
        matching.pack_texels(greys[1]),
        np.array([[0, 64, 48]], np.int32),
        transfer(a, b)[None].astype(np.float32),
        transfer(b, a)[None].astype(np.float32),
        np.tile(np.float32([0.0, 0.0, 1 / 3]), (48 * 64, 1)),
        np.float32(0.0),
    )
    planes = np.zeros((48, 64, 3), np.float32)
    planes[..., :2] = rng.uniform(-1e-3, 1e-3, (48, 64, 2))
    planes[..., 2] = rng.uniform(0.25, 0.5, (48, 64))
    field = patchmatch.Field(planes, np.zeros((48, 64), np.float32), np.zeros((48, 64, 1), np.float32))
    return a, b, greys, reference, sources, field


@pytest.fixture
def pair():
    return random_pair()


def bilinear(grey: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    x, y = u - 0.5, v - 0.5
    ix, iy = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - ix, y - iy
    top = grey[iy, ix] * (1 - fx) + grey[iy, ix + 1] * fx
    bottom = grey[iy + 1, ix] * (1 - fx) + grey[iy + 1, ix + 1] * fx
    return top * (1 - fy) + bottom * fy


def reference_cost(greys, opponent, matrix, plane, window, x: int, y: int) -> float:
    """Bilaterally weighted 1 - NCC in float64, straight from its definition."""
    du, dv = window.offsets.astype(int)
    used = window.spatial > 0
    used &= (x + du >= 0) & (x + du < 64) & (y + dv >= 0) & (y + dv < 48)
    du, dv, weight = du[used], dv[used], window.spatial[used].astype(float)
    patch = greys[0][y + dv, x + du].astype(float)
    colour = np.abs(opponent[:, y + dv, x + du] - opponent[:, y, x, None]).max(axis=0)
    tone = np.rint(np.maximum(np.abs(patch - greys[0][y, x]), colour) * 255).astype(int)
    weight = weight * window.tonal[np.minimum(tone, 255)]
    weight /= weight.sum()
    u, v = x + du + 0.5, y + dv + 0.5
    w = plane[0] * u + plane[1] * v + plane[2]
    px, py, pz = matrix @ np.stack([u, v, np.ones_like(u), w])
    other = bilinear(greys[1].astype(float), px / pz, py / pz)
    mean_a, mean_b = weight @ patch, weight @ other
    var_a, var_b = weight @ (patch - mean_a) ** 2, weight @ (other - mean_b) ** 2
    covariance = weight @ ((patch - mean_a) * (other - mean_b))
    return 1.0 - covariance / np.sqrt((var_a + 4e-6) * (var_b + 4e-6))


def test_the_cost_is_the_weighted_ncc(pair) -> None:
    a, b, greys, reference, sources, field = pair
    window = matching.window(4)
    patchmatch.score(field, reference, sources, window)
    matched = np.argwhere(field.source_costs[..., 0] < matching.WORST_COST)
    assert len(matched) > 1000
    matrix = transfer(a, b)
    for y, x in matched[:: len(matched) // 200]:
        expected = reference_cost(greys, reference.opponent, matrix, field.planes[y, x], window, x, y)
        assert field.source_costs[y, x, 0] == pytest.approx(expected, abs=3e-3)


def test_what_is_as_bright_and_of_another_colour_has_no_weight() -> None:
    """A blue bowl before brown wood: of a window across its rim the samples on the pixel's own side count."""
    grey = np.random.default_rng(3).uniform(0.4, 0.44, (32, 32)).astype(np.float32)
    opponent = np.zeros((2, 32, 32), np.float32)
    opponent[:, :, 16:] = [[[0.1]], [[-0.5]]]
    window = matching.window(5)
    weights = np.empty((2, window.offsets.shape[1]), np.float32)
    matching.weigh_patch(grey, opponent, *window, 15, 12, weights)
    beyond = window.offsets[0] > 0
    assert weights[0].sum() == pytest.approx(1.0, abs=1e-5)
    assert weights[0, beyond].sum() < 1e-3
    matching.weigh_patch(grey, 0.0 * opponent, *window, 15, 12, weights)
    assert weights[0, beyond].sum() > 0.3


@pytest.mark.parametrize(("radius_px", "stride_px"), [(r, s) for r in range(2, 16) for s in range(1, min(r, 4) + 1)])
def test_a_window_lies_around_its_pixel(radius_px, stride_px) -> None:
    offsets, spatial, _ = matching.window(radius_px, stride_px)
    middle = offsets[:, spatial > 0.0].mean(axis=1)
    assert np.abs(middle).max() <= 0.5 and np.abs(offsets).max() <= radius_px


def test_a_patch_that_leaves_the_source_has_the_worst_cost(pair) -> None:
    a, b, _, reference, sources, field = pair
    window = matching.window(4)
    patchmatch.score(field, reference, sources, window)
    v, u = np.mgrid[:48, :64] + 0.5
    w = (field.planes * np.stack([u, v, np.ones_like(u)], -1)).sum(-1)
    pixels, _ = b.project(a.unproject(1.0 / w))
    outside = (pixels < 0).any(-1) | (pixels[..., 0] > 64) | (pixels[..., 1] > 48)
    assert outside.any()
    assert (field.source_costs[outside, 0] == matching.WORST_COST).all()


def test_identical_images_at_infinity_cost_nothing(pair) -> None:
    *_, reference, sources, field = pair
    same = sources._replace(texels=matching.pack_texels(reference.grey), to_source=np.eye(3, 4, dtype=np.float32)[None])
    patchmatch.score(field, reference, same, matching.window(5))
    # Not nothing: the noise added to the variances keeps the correlation below 1.
    assert np.abs(field.source_costs[8:-8, 8:-8, 0]).max() < 1e-2


def test_the_geometric_term_is_the_reprojection_error(pair) -> None:
    a, b, _, reference, sources, field = pair
    window = matching.window(4)
    patchmatch.score(field, reference, sources, window)
    plain = field.source_costs.copy()
    patchmatch.score(field, reference, sources._replace(geometric_weight=np.float32(0.25)), window)
    v, u = np.mgrid[:48, :64] + 0.5
    w = (field.planes * np.stack([u, v, np.ones_like(u)], -1)).sum(-1)
    pixels, depth = b.project(a.unproject(1.0 / w))
    inside = b.sees(pixels, depth, 0.01)
    rays = np.concatenate([(pixels - LENS[2:]) / LENS[:2], np.ones((48, 64, 1))], -1)
    seen = (rays * 3.0) @ b.world_from_camera[:3, :3].T + b.centre
    back, _ = a.project(seen)
    error = np.linalg.norm(back - np.stack([u, v], -1), axis=-1).clip(max=3.0)
    error = np.where(inside, error, 3.0)
    decided = inside == b.sees(pixels, depth, -0.01)
    found = (field.source_costs - plain)[..., 0]
    np.testing.assert_allclose(found[decided], 0.25 * error[decided], atol=2e-3)


def test_random_planes_are_admissible_and_spread_in_inverse_depth(pair) -> None:
    reference = pair[3]
    planes = np.zeros((48, 64, 3), np.float32)
    patchmatch.initialise(planes, reference, 0, 5)
    v, u = np.mgrid[:48, :64] + 0.5
    w = (planes * np.stack([u, v, np.ones_like(u)], -1)).sum(-1)
    assert w.min() >= 1 / 8 - 1e-4 and w.max() <= 2.0 + 1e-4
    counts, _ = np.histogram(w, bins=8, range=(1 / 8, 2.0))
    assert counts.min() > 0.7 * counts.mean()
    again = planes.copy()
    patchmatch.initialise(again, reference, 1, 5)
    np.testing.assert_array_equal(again, planes)


def test_regions_hold_pixels_of_the_other_colour_only() -> None:
    regions = patchmatch.sampling_regions()
    assert regions.shape == (8, 11, 2)
    assert (np.abs(regions.sum(axis=-1)) % 2 == 1).all()
    assert len({tuple(offset) for offset in regions.reshape(-1, 2)}) == 4 * 7 + 4 * 11


def test_a_sweep_never_raises_a_cost_with_one_source(pair) -> None:
    *_, reference, sources, field = pair
    window, regions = matching.window(4), patchmatch.sampling_regions()
    patchmatch.score(field, reference, sources, window)
    before = field.source_costs.copy()
    for colour in range(2):
        patchmatch.half_sweep(field, reference, sources, window, regions, colour, 1, np.float32(1.0), 0)
    assert (field.source_costs <= before + 1e-5).all()
    assert field.source_costs.mean() < before.mean() - 0.1
