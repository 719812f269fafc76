"""Planes through the neighbours of points."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.splats.quaternions import to_rotation
from r2sego_blender.splats.training import local_planes as module
from r2sego_blender.splats.training.local_planes import local_planes


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.floats(0.01, 100.0), st.integers(17, 200))
def test_points_of_a_plane_show_it_wherever_it_lies(seed: int, size_m: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    rotation = to_rotation(rng.normal(size=(1, 4)))[0].astype(np.float64)
    rotation = np.linalg.qr(rotation)[0]
    flat = np.column_stack([rng.uniform(-size_m, size_m, (count, 2)), np.zeros(count)])
    axes, thickness = local_planes(flat @ rotation.T + rng.normal(size=3) * size_m)
    np.testing.assert_allclose(np.abs(axes[:, :, 0] @ rotation[:, 2]), 1.0, atol=1e-6)
    assert thickness.max() < 1e-4
    np.testing.assert_allclose(np.linalg.det(axes), 1.0, atol=1e-9)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.broadcast_to(np.eye(3), axes.shape), atol=1e-9)


def test_thickness_is_the_noise_of_a_surface_and_high_in_a_cloud() -> None:
    rng = np.random.default_rng(0)
    ratios = []
    for noise_m in (0.01, 0.03, 0.1):
        points = np.column_stack([rng.uniform(0.0, 10.0, (3000, 2)), rng.normal(0.0, noise_m, 3000)])
        ratios.append(np.median(local_planes(points)[1]))
    assert 2.5 < ratios[1] / ratios[0] < 3.5  # as the noise
    assert ratios[2] > 0.4  # a noise as wide as the sixteen neighbours
    cloud = local_planes(rng.normal(size=(3000, 3)))[1]
    assert np.quantile(cloud, 0.1) > 0.5
    assert cloud.max() <= 1.0


def test_two_walls_keep_their_own_planes_but_near_the_corner() -> None:
    rng = np.random.default_rng(0)
    wall = np.column_stack([rng.uniform(0, 4, 4000), np.zeros(4000), rng.uniform(0, 2.5, 4000)])
    floor = np.column_stack([rng.uniform(0, 4, 4000), rng.uniform(0, 4, 4000), np.zeros(4000)])
    axes, thickness = local_planes(np.concatenate([wall, floor]))
    far = np.concatenate([wall[:, 2] > 0.3, floor[:, 1] > 0.3])
    normal = np.concatenate([np.repeat([[0, 1, 0]], 4000, 0), np.repeat([[0, 0, 1]], 4000, 0)])
    cosine = np.abs((axes[:, :, 0] * normal).sum(1))
    assert cosine[far].min() > 0.999
    assert thickness[far].max() < 1e-3
    assert np.quantile(thickness[~far], 0.8) > 0.3


def test_points_on_a_line_or_in_one_place_are_in_no_plane() -> None:
    line = np.outer(np.arange(40.0), [1.0, 2.0, -1.0])
    for points in (line, np.zeros((20, 3)), line[:4]):
        axes, thickness = local_planes(points)
        assert (thickness == 1.0).all()
        assert np.isfinite(axes).all()


def test_chunks_change_nothing(monkeypatch) -> None:
    points = np.random.default_rng(0).normal(size=(1000, 3))
    whole = local_planes(points)
    monkeypatch.setattr(module, "_CHUNK", 77)
    for one, other in zip(whole, local_planes(points), strict=True):
        np.testing.assert_array_equal(one, other)
