"""Estimates of a room whose depth is known, disturbed as models disturb it, brought back."""

from __future__ import annotations

import numpy as np
import pytest
from box_room import arc, render
from disturbed_depth import disturbed
from hypothesis import given, settings
from hypothesis import strategies as st

from r2sego_blender.captures.capture import Capture
from r2sego_blender.captures.sparse_points import SparsePoints
from r2sego_blender.core.errors import GeometryError
from r2sego_blender.core.progress import Progress
from r2sego_blender.geometry.estimators.aligned_depth import AlignedDepth
from r2sego_blender.geometry.estimators.aligning import align_estimates
from r2sego_blender.geometry.estimators.alignment import aligned, fitted
from r2sego_blender.geometry.estimators.estimated_depth import EstimatedDepth
from r2sego_blender.geometry.estimators.floor import floor_depth as depth_of_floor
from r2sego_blender.geometry.estimators.floor import floor_in
from r2sego_blender.geometry.stereo.evidence import KnownDepth

COUNT = 5
NO_POINTS = SparsePoints.none(COUNT)


class Told(Progress):
    """Keeps what was said."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def message(self, text: str, level: str = "info") -> None:
        if level == "warning":
            self.warnings.append(text)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Captures without pictures, their true depth, and what of it is known: a third of the picture, in patches."""
    cameras = arc(COUNT)
    folder = tmp_path_factory.mktemp("nothing")
    captures = [Capture(f"{index}.png", folder / f"{index}.png", camera) for index, camera in enumerate(cameras)]
    depths = [render(camera)[1] for camera in cameras]
    rng = np.random.default_rng(2)
    known = []
    for camera, depth in zip(cameras, depths, strict=True):
        seen = np.kron(rng.random((8, 10)) < 0.33, np.ones((15, 16), bool))
        known.append(KnownDepth(camera, np.where(seen, depth, 0.0).astype(np.float32)))
    return captures, depths, known


def estimate(values: np.ndarray) -> EstimatedDepth:
    depth = np.asarray(values, np.float32)
    return EstimatedDepth(depth, (depth > 0.0).astype(np.float32))


@settings(max_examples=40, deadline=None)
@given(
    scale=st.floats(0.05, 20.0),
    shift=st.floats(-0.3, 0.5),
    inverse=st.booleans(),
    lies=st.floats(0.0, 0.35),
    seed=st.integers(0, 99),
)
def test_scale_and_shift_come_back_though_a_third_of_what_is_known_is_wrong(scale, shift, inverse, lies, seed):
    rng = np.random.default_rng(seed)
    true = rng.uniform(1.0, 5.0, 2000)
    value = scale * ((1.0 / true if inverse else true) + shift * (0.2 if inverse else 1.0))
    kept = value > 0.02 * scale
    depth = np.where(kept, 1.0 / np.maximum(value, 1e-9), 1.0) if inverse else np.where(kept, value, 1.0)
    wrong = rng.random(2000) < lies
    found = fitted(depth[kept], np.where(wrong, rng.uniform(1.0, 5.0, 2000), true)[kept])
    assert found is not None
    off = np.abs(found.of(depth)[kept & ~wrong] / true[kept & ~wrong] - 1.0)
    assert np.quantile(off, 0.95) < 0.02


def test_estimates_are_within_what_they_say_they_are_off_by(room):
    captures, depths, known = room
    rng = np.random.default_rng(4)
    maps = [estimate(disturbed(depth, rng)) for depth in depths]
    shares, errors = [], []
    for one, true, view in zip(align_estimates(captures, NO_POINTS, known, maps), depths, known, strict=True):
        asked = (one.depth > 0.0) & (view.depth <= 0.0)
        assert asked.sum() > 0.9 * (view.depth <= 0.0).sum()
        off = np.abs(np.log(one.depth[asked] / true[asked]))
        errors.append(np.median(off))
        shares.append([(off < times * one.sigma[asked]).mean() for times in (1.0, 2.0, 3.0)])
        assert np.median(one.sigma[asked]) < 0.06  # saying little would be no merit
    assert (np.mean(shares, axis=0) > [0.6, 0.87, 0.95]).all()
    assert np.mean(errors) < 0.034  # the median of a normal error of 5 %


def test_beside_edges_and_where_nothing_like_it_was_known_an_estimate_is_less_sure(room):
    _, depths, known = room
    true, near = depths[2], np.where(known[2].depth < 3.0, known[2].depth, 0.0)
    found = aligned(disturbed(true, np.random.default_rng(0)), np.ones_like(true), near)
    assert found is not None
    assert np.median(found.sigma[true > 3.3]) > np.median(found.sigma[true < 2.8])


def test_a_wall_that_others_see_through_enters_nowhere(room):
    captures, depths, known = room
    maps = [estimate(depth) for depth in depths]
    lie = depths[2].copy()
    lie[:, 50:110] = 0.9
    lying = align_estimates(captures, NO_POINTS, known, [*maps[:2], estimate(lie), *maps[3:]])
    honest = align_estimates(captures, NO_POINTS, known, maps)
    assert (honest[2].depth > 0.0).mean() > 0.95
    assert (lying[2].depth[:, 50:110] > 0.0).mean() < 0.01
    for one, true in zip(lying, depths, strict=True):
        kept = one.depth > 0.0
        assert (np.abs(one.depth / true - 1.0)[kept] < 0.05).mean() > 0.99


def test_a_capture_that_shares_nothing_is_brought_along_by_the_others(room):
    captures, depths, known = room
    alone = [*known[:4], KnownDepth(known[4].camera, np.zeros_like(known[4].depth))]
    maps = [estimate(factor * depth) for factor, depth in zip((2.0, 0.5, 1.0, 3.0, 7.0), depths, strict=True)]
    told = Told()
    found = align_estimates(captures, NO_POINTS, alone, maps, told)
    assert not told.warnings
    kept = found[4].depth > 0.0
    assert kept.mean() > 0.9 and np.median(np.abs(found[4].depth / depths[4] - 1.0)[kept]) < 0.02


def test_what_nothing_can_align_is_left_out_and_named(room):
    captures, depths, known = room
    rng = np.random.default_rng(1)
    noise = rng.uniform(0.1, 9.0, depths[3].shape)
    nothing = [KnownDepth(one.camera, np.zeros_like(one.depth)) for one in known]
    told = Told()
    found = align_estimates(captures, NO_POINTS, known, [None, None, None, estimate(noise), None], told)
    assert len(told.warnings) == 1 and "3.png" in told.warnings[0]
    assert not any(one.depth.any() for one in found)
    told = Told()
    above = [estimate(np.where(depth_of_floor(one.camera) > 0.0, 0.0, d)) for one, d in zip(known, depths, strict=True)]
    align_estimates(captures, NO_POINTS, nothing, above, told)
    assert len(told.warnings) == COUNT


def test_the_floor_alone_aligns_what_shares_nothing(room):
    captures, depths, known = room
    rng = np.random.default_rng(8)
    nothing = [KnownDepth(one.camera, np.zeros_like(one.depth)) for one in known]
    scales = (0.1, 0.5, 1.0, 3.0, 70.0)
    maps = [estimate(factor * disturbed(depth, rng)) for factor, depth in zip(scales, depths, strict=True)]
    told = Told()
    found = align_estimates(captures, NO_POINTS, nothing, maps, told)
    assert not told.warnings
    for one, true in zip(found, depths, strict=True):
        kept = one.depth > 0.0
        off = np.abs(np.log(one.depth[kept] / true[kept]))
        assert kept.mean() > 0.8 and np.median(off) < 0.05
        assert (off < 2.0 * one.sigma[kept]).mean() > 0.8


def test_what_is_floor_is_told_by_what_lies_on_it_and_nothing_under_it(room):
    _, depths, known = room
    for view, true in zip(known, depths, strict=True):
        camera = view.camera
        on_floor = np.abs(camera.unproject(true)[..., 2]) < 0.01
        found = floor_in(5.0 * true, camera) > 0.0
        assert on_floor[found].mean() > 0.98
        assert found[on_floor].mean() > 0.7
    assert not floor_in(np.where(depth_of_floor(camera) > 0.0, 0.0, true), camera).any()


def test_sparse_points_alone_align(room):
    captures, depths, known = room
    rows, columns = np.random.default_rng(6).integers(5, 115, (2, 60))
    points = captures[0].camera.unproject(depths[0])[rows, columns]
    seen = np.zeros((60, COUNT), bool)
    seen[:, :2] = True
    sparse = SparsePoints(points, np.zeros((60, 3), np.uint8), seen, np.zeros(60), np.zeros((60, COUNT, 2), np.float32))
    nothing = [KnownDepth(one.camera, np.zeros_like(one.depth)) for one in known]
    found = align_estimates(captures, sparse, nothing, [estimate(4.0 * depths[0]), *[None] * 4])
    kept = found[0].depth > 0.0
    assert kept.mean() > 0.9 and np.median(np.abs(found[0].depth / depths[0] - 1.0)[kept]) < 0.02


def test_an_estimate_of_another_size_is_refused(room):
    captures, depths, known = room
    with pytest.raises(GeometryError, match=r"0\.png"):
        align_estimates(captures, NO_POINTS, known, [estimate(depths[0][:, :100]), *[None] * 4])


def test_files_of_estimates_come_back_and_others_are_refused(room, tmp_path):
    _, depths, known = room
    one = estimate(depths[0])
    one.save(tmp_path / "e.npz")
    assert (EstimatedDepth.load(tmp_path / "e.npz").depth == one.depth).all()
    brought = AlignedDepth(depths[0], 0.05 * np.ones_like(depths[0]), known[0].camera)
    brought.save(tmp_path / "a.npz")
    assert (AlignedDepth.load(tmp_path / "a.npz").sigma == brought.sigma).all()
    with pytest.raises(GeometryError):
        AlignedDepth.load(tmp_path / "e.npz")
    EstimatedDepth(depths[0], 0.0 * depths[0]).save(tmp_path / "exact.npz")
    with pytest.raises(GeometryError):
        EstimatedDepth.load(tmp_path / "exact.npz")
