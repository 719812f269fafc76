from __future__ import annotations

import math

import numpy as np
import pytest
from vector_calls import mapped

from r2sego_blender.splats.vector_language.exponentials import EXP2_OF_EIGHTHS, exp2, exp2_of_eighths, log2
from r2sego_blender.splats.vector_language.vectors import Code, Value


def test_exp2_is_accurate_over_its_range() -> None:
    edges = [-126.0, 126.9999, 0.0, 0.5, -0.5, 1.5, -1.5, 0.49999997]
    x = np.concatenate([np.linspace(-126.0, 126.999, 1 << 16), np.repeat(np.float32(edges), 2)])
    x = x.astype(np.float32)
    expected = np.exp2(x.astype(np.float64))
    assert np.abs(mapped(lambda code, v: exp2(v), x) / expected - 1.0).max() < 2e-7


def _of_eighths(x: np.ndarray) -> np.ndarray:
    def write(code: Code, value: Value) -> Value:
        return exp2_of_eighths(value, [code.vector(c) for c in EXP2_OF_EIGHTHS])

    return mapped(write, x.astype(np.float32))


def test_exp2_of_eighths_is_accurate_over_its_range() -> None:
    x = np.linspace(-15.0, 15.0, 1 << 18).astype(np.float32)
    assert np.abs(_of_eighths(x) / np.exp2(8.0 * x.astype(np.float64)) - 1.0).max() < 4e-6


def test_exp2_of_eighths_gives_whole_powers_nearly_exactly_and_does_not_jump_between_them() -> None:
    whole = np.arange(-8, 8)
    assert np.abs(_of_eighths(whole / 8.0) / np.exp2(whole) - 1.0).max() < 4e-6
    halves = (np.arange(-8, 8) + 0.5) / 8.0  # where the nearest whole number changes
    below, above = (_of_eighths(halves + shift) for shift in (-1e-7, 1e-7))
    assert np.abs(above / below - 1.0).max() < 8e-6


def test_log2_is_accurate_for_all_normal_floats() -> None:
    rng = np.random.default_rng(0)
    x = np.exp2(rng.uniform(-126.0, 127.99, 1 << 16)).astype(np.float32)
    near_one = (1.0 + rng.uniform(-0.3, 0.42, 1 << 14)).astype(np.float32)
    for values in (x, near_one):
        expected = np.log2(values.astype(np.float64))
        rounding = 0.5 * np.spacing(np.abs(expected).astype(np.float32))
        assert (np.abs(mapped(lambda code, v: log2(v), values) - expected) - rounding).max() < 2e-7


def test_the_coefficients_are_those_of_a_power_of_two() -> None:
    *coefficients, counts = EXP2_OF_EIGHTHS
    assert np.polyval(coefficients, 1.0 / 16.0) == pytest.approx(math.sqrt(2.0), rel=4e-6)
    assert coefficients[-2] == pytest.approx(8.0 * math.log(2.0), rel=1e-4)
    assert np.spacing(np.float32(counts)) == 1.0 / 8.0
