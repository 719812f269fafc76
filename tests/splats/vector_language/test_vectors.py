from __future__ import annotations

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numba.core.types import int64, void
from vector_calls import compiled, mapped, random, scalar_results

from r2sego_blender.splats.vector_language.vectors import LANES, Code, Value, vector_kernel

LANE = np.arange(LANES)
FLOATS = hnp.arrays(np.float32, (2, LANES), elements=st.floats(width=32))


def as_int32(rows: np.ndarray) -> np.ndarray:
    return rows.view(np.int32)


def test_quotients_and_roots_are_accurate() -> None:
    x = np.geomspace(1e-30, 1e30, 1 << 14).astype(np.float32)
    wide = x.astype(np.float64)
    quotient = mapped(lambda code, v: code.quotient(3.0, v), x)
    assert np.abs(quotient * wide / 3.0 - 1.0).max() < 3e-7
    assert np.abs(mapped(lambda code, v: 3.0 / v, x) * wide / 3.0 - 1.0).max() < 3e-7
    assert np.abs(mapped(Code.sqrt, x) / np.sqrt(wide) - 1.0).max() < 3e-7


def test_rint_takes_the_even_one_of_two() -> None:
    x = np.float32([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 0.49999997, -7.3, 8388607.5, 1e30, *range(6)])
    np.testing.assert_array_equal(mapped(Code.rint, x), np.rint(x))


@pytest.mark.parametrize("lanes", [4, 8, 16])
def test_what_is_cut_is_computed_with_and_padded_again(lanes: int) -> None:
    def write(code: Code, a: Value, b: Value) -> list[Value]:
        parts = zip(code.cut(a, lanes), code.cut(b, lanes), strict=True)
        return [code.padded(code.fma(x, y, x - y)) for x, y in parts]

    rows = random((2, LANES))
    a, b = rows.reshape(2, -1, lanes).astype(np.float64)
    expected = np.pad(a * b + (a - b), ((0, 0), (0, LANES - lanes)))
    np.testing.assert_allclose(compiled(write, 2)(rows), expected, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_shuffled_takes_lanes_of_both(seed: int) -> None:
    rows = random((2, LANES), seed)
    order = np.random.default_rng(seed).integers(0, 2 * LANES, LANES)
    found = compiled(lambda code, a, b: [code.shuffled(a, b, order)], 2)(rows)
    np.testing.assert_array_equal(found[0], rows.ravel()[order])


COMPARED = compiled(
    lambda code, a, b: [
        code.minimum(a, b),
        code.maximum(a, b),
        *(code.select(mask, 1.0, 0.0) for mask in (a < b, a <= b, a > b, a >= b, a.equals(b), a.differs(b))),
        code.select(a > b, a, b),
        code.absolute(a),
        code.minimum(code.maximum(a, -2.0), 2.0),
    ],
    2,
)


@given(FLOATS)
def test_comparisons_reject_nan_and_a_bound_replaces_it(values: np.ndarray) -> None:
    a, b = values
    found = COMPARED(values)
    np.testing.assert_array_equal(found[0], np.where(a < b, a, b))
    np.testing.assert_array_equal(found[1], np.where(a > b, a, b))
    ordered = ~(np.isnan(a) | np.isnan(b))
    expected = (a < b, a <= b, a > b, a >= b, a == b, (a != b) & ordered)
    np.testing.assert_array_equal(found[2:8], np.float32(expected))
    np.testing.assert_array_equal(found[8], np.where(a > b, a, b))
    np.testing.assert_array_equal(found[9], np.abs(a))
    np.testing.assert_array_equal(found[10], np.where(np.isnan(a), -2.0, np.clip(a, -2.0, 2.0)))


def test_arithmetic_of_vectors_scalars_and_numbers() -> None:
    a, b = random((2, LANES)) + 3.0

    def write(code: Code, x: Value, y: Value) -> list[Value]:
        first = y.lane(0)
        return [
            x + y,
            x - y,
            x * y,
            x / y,
            -x,
            2.0 + x,
            2.0 - x,
            2.0 / x,
            x * first,
            first - x,
            code.fma(x, y, 1.0),
            code.fma(x, first, y),
            code.with_lane(x, 5, first),
            code.spread(first),
        ]

    found = compiled(write, 2)(np.stack([a, b]))
    replaced = np.where(LANE == 5, b[0], a)
    expected = [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        2 + a,
        2 - a,
        2 / a,
        a * b[0],
        b[0] - a,
        a * b + 1,
        a * b[0] + b,
        replaced,
        np.full(LANES, b[0]),
    ]
    np.testing.assert_allclose(found, expected, rtol=5e-7)


def test_integers_shift_divide_and_become_floats() -> None:
    numbers = LANE * 37 - 300

    def write(code: Code) -> list[Value]:
        x = code.integers(numbers)
        return [
            x + 5,
            5 - x,
            x * 3,
            x / 7,
            x >> 2,
            code.integers(1) << code.integers(LANE),
            x & 255,
            x | 1,
            code.to_integers(code.vector(numbers * 0.3)),
            code.select(x > 0, x, code.integers(-1)),
        ]

    found = as_int32(compiled(write, 0)(np.zeros((0, LANES))))
    expected = [
        numbers + 5,
        5 - numbers,
        numbers * 3,
        np.trunc(numbers / 7),
        numbers >> 2,
        1 << LANE,
        numbers & 255,
        numbers | 1,
        np.trunc(numbers * 0.3),
        np.where(numbers > 0, numbers, -1),
    ]
    np.testing.assert_array_equal(found, np.array(expected, np.int64))
    as_floats = compiled(lambda code: [code.to_floats(code.integers(numbers))], 0)(np.zeros((0, LANES)))
    np.testing.assert_array_equal(as_floats[0], numbers)


@pytest.mark.parametrize("count", [0, 1, 7, 15, 16])
def test_the_bits_of_a_mask_are_its_lanes(count: int) -> None:
    def write(code: Code, count: Value) -> list[Value]:
        mask = code.integers(range(LANES)) < code.to_int(count)
        return [code.bits(mask), code.bits(code.select(mask, 1.0, 0.0) > 0.5)]

    assert scalar_results(write, count) == [(1 << count) - 1] * 2


def test_bytes_of_takes_the_lowest_byte_of_each_lane() -> None:
    numbers = np.random.default_rng(0).integers(-(2**31), 2**31, LANES)
    found = scalar_results(lambda code: [*code.bytes_of(code.integers(numbers))])
    low = (numbers & 255).astype(np.uint8)
    assert found == low.view(np.int64).tolist()


def test_scalars_convert_towards_zero() -> None:
    def write(code: Code, x: Value) -> list[Value]:
        real = code.to_floats(x)
        return [code.to_long(real * 0.4), code.to_long(real * -0.4), code.trailing_zeros(x)]

    assert scalar_results(write, 24) == [9, -9, 3]
    assert scalar_results(write, -(2**63))[2] == 63


def test_loops_run_from_start_below_count() -> None:
    def write(code: Code, count: Value, start: Value) -> list[Value]:
        times, total = code.variable(code.long(0)), code.variable(code.long(0))
        with code.loop(count) as i, code.loop(i) as j:
            times.add(code.long(1))
            total.add(i * 100 + j)
        after = code.variable(code.long(0))
        with code.loop(count, start) as i:
            after.add(i)
        halvings = code.variable(code.long(0))
        rest = code.variable(count)
        with code.loop_while(lambda: rest.get() > 1):
            rest.set(rest.get() >> 1)
            halvings.add(code.long(1))
        with code.when(halvings.get() > 2):
            halvings.add(code.long(1000))
        return [times.get(), total.get(), after.get(), halvings.get()]

    expected_total = sum(100 * i + j for i in range(7) for j in range(i))
    assert scalar_results(write, 7, 3) == [21, expected_total, 3 + 4 + 5 + 6, 2]
    assert scalar_results(write, 0, 3) == [0, 0, 0, 0]
    assert scalar_results(write, 9, 9)[2:] == [0, 1003]


@vector_kernel(void(int64, int64))
def each_bit(code, bits, target):
    place = code.variable(target)
    with code.loop_bits(bits) as number:
        code.store_long(place.get(), number)
        place.add(code.long(8))


@numba.njit
def store_numbers_of_bits(bits, target):
    each_bit(bits, target)


@given(st.integers(-(2**63), 2**63 - 1))
def test_loop_bits_visits_the_set_bits_from_the_lowest(bits: int) -> None:
    found = np.full(65, -1, np.int64)
    store_numbers_of_bits(bits, found.ctypes.data)
    expected = [k for k in range(64) if bits >> k & 1]
    assert found[: len(expected)].tolist() == expected
    assert (found[len(expected) :] == -1).all()


def test_floats_and_integers_in_memory() -> None:
    @vector_kernel(int64(int64, int64))
    def body(code, reals, numbers):
        code.store_float(reals + 4, code.load_float(reals) * 2.0)
        return code.load_int(numbers) + code.load_int(numbers + 4)

    @numba.njit
    def call(reals, numbers):
        return body(reals, numbers)

    reals, numbers = np.array([1.25, 0.0], np.float32), np.array([-7, 3], np.int32)
    assert call(reals.ctypes.data, numbers.ctypes.data) == -4
    assert reals[1] == 2.5
