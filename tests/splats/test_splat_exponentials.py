from __future__ import annotations

import math

import numpy as np
import pytest
from vector_calls import mapped

from r2sego_blender.splats.exponentials import EXP2_COEFFICIENTS_BELOW_0, exp2, exp2_small, log2
from r2sego_blender.splats.vectors import Code, Value


def test_exp2_is_accurate_over_its_range() -> None:
    edges = [-126.0, 126.9999, 0.0, 0.5, -0.5, 1.5, -1.5, 0.49999997]
    x = np.concatenate([np.linspace(-126.0, 126.999, 1 << 16), np.repeat(np.float32(edges), 2)])
    x = x.astype(np.float32)
    expected = np.exp2(x.astype(np.float64))
    assert np.abs(mapped(lambda code, v: exp2(v), x) / expected - 1.0).max() < 2e-7


def test_exp2_small_is_accurate_over_its_range_and_never_nan_outside() -> None:
    def small(code: Code, x: Value) -> Value:
        return exp2_small(x, [code.vector(c) for c in EXP2_COEFFICIENTS_BELOW_0])

    inside = np.linspace(-1.0, 0.0, 1 << 14).astype(np.float32)
    outside = -np.geomspace(1.0, 3e38, 1 << 12).astype(np.float32)
    outside[-1] = -np.inf
    found = mapped(small, np.concatenate([inside, outside, -outside]))
    assert np.abs(found[: len(inside)] / np.exp2(8.0 * inside.astype(np.float64)) - 1.0).max() < 2e-6
    assert not np.isnan(found).any()


def test_log2_is_accurate_for_all_normal_floats() -> None:
    rng = np.random.default_rng(0)
    x = np.exp2(rng.uniform(-126.0, 127.99, 1 << 16)).astype(np.float32)
    near_one = (1.0 + rng.uniform(-0.3, 0.42, 1 << 14)).astype(np.float32)
    for values in (x, near_one):
        expected = np.log2(values.astype(np.float64))
        rounding = 0.5 * np.spacing(np.abs(expected).astype(np.float32))
        assert (np.abs(mapped(lambda code, v: log2(v), values) - expected) - rounding).max() < 2e-7


def test_the_coefficients_are_those_of_a_power_of_two() -> None:
    assert np.polyval(EXP2_COEFFICIENTS_BELOW_0, -1.0) == pytest.approx(0.5, rel=1e-6)
    assert EXP2_COEFFICIENTS_BELOW_0[-2] == pytest.approx(math.log(2.0), rel=1e-4)
