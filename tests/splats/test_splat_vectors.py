from __future__ import annotations

import math
import platform
from collections.abc import Callable

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numba.core.types import int32, int64, void

from r2sego_blender.splats.vectors import (
    EXP2_COEFFICIENTS_BELOW_0,
    LANES,
    VECTOR_BYTES,
    Code,
    Value,
    aligned,
    flush_denormals,
    restore_denormals,
    vector_kernel,
)

LANE = np.arange(LANES)
FLOATS = hnp.arrays(np.float32, (2, LANES), elements=st.floats(width=32))
Write = Callable[..., list[Value]]


def compiled(write: Write, inputs: int) -> Callable[[np.ndarray], np.ndarray]:
    """A function from (inputs, 16) to the vectors (n, 16) that ``write(code, *vectors)`` lists."""
    written = 0

    @vector_kernel(void(int64, int64))
    def body(code, source, target):
        nonlocal written
        rows = write(code, *(code.load(source + VECTOR_BYTES * k) for k in range(inputs)))
        written = len(rows)
        for k, row in enumerate(rows):
            code.store(target + VECTOR_BYTES * k, row)

    @numba.njit
    def call(source, target):
        body(source, target)

    def run(values: np.ndarray) -> np.ndarray:
        source, target = aligned((inputs, LANES)), aligned((64, LANES))
        source[:] = values
        call(source.ctypes.data, target.ctypes.data)
        return target[:written].copy()

    return run


def mapped(function: Callable[[Code, Value], Value], values: np.ndarray) -> np.ndarray:
    """A function of one vector at many values, float64 of float32 results."""

    @vector_kernel(void(int64, int64, int64))
    def body(code, source, target, count):
        with code.loop(count) as i:
            code.store(target + i * VECTOR_BYTES, function(code, code.load(source + i * VECTOR_BYTES)))

    @numba.njit
    def call(source, target, count):
        body(source, target, count)

    source, target = aligned((len(values) // LANES, LANES)), aligned((len(values) // LANES, LANES))
    source[:] = values.reshape(-1, LANES)
    call(source.ctypes.data, target.ctypes.data, len(source))
    return target.ravel().astype(np.float64)


def as_int32(rows: np.ndarray) -> np.ndarray:
    return rows.view(np.int32)


def random(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def test_exp2_is_accurate_over_its_range() -> None:
    edges = [-126.0, 126.9999, 0.0, 0.5, -0.5, 1.5, -1.5, 0.49999997]
    x = np.concatenate([np.linspace(-126.0, 126.999, 1 << 16), np.repeat(np.float32(edges), 2)])
    x = x.astype(np.float32)
    expected = np.exp2(x.astype(np.float64))
    assert np.abs(mapped(Code.exp2, x) / expected - 1.0).max() < 2e-7


def test_exp2_small_is_accurate_over_its_range_and_never_nan_outside() -> None:
    def small(code: Code, x: Value) -> Value:
        return code.exp2_small(x, [code.vector(c) for c in EXP2_COEFFICIENTS_BELOW_0])

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
        assert (np.abs(mapped(Code.log2, values) - expected) - rounding).max() < 2e-7


def test_quotients_and_roots_are_accurate() -> None:
    x = np.geomspace(1e-30, 1e30, 1 << 14).astype(np.float32)
    wide = x.astype(np.float64)
    quotient = mapped(lambda code, v: code.quotient(3.0, v), x)
    assert np.abs(quotient * wide / 3.0 - 1.0).max() < 3e-7
    assert np.abs(mapped(lambda code, v: 3.0 / v, x) * wide / 3.0 - 1.0).max() < 3e-7
    assert np.abs(mapped(Code.sqrt, x) / np.sqrt(wide) - 1.0).max() < 3e-7


@pytest.mark.parametrize("count", range(1, LANES + 1))
def test_sums_put_each_vectors_sum_in_the_lane_of_its_number(count: int) -> None:
    rows = random((count, LANES), count)
    both = compiled(lambda code, *v: [code.sums(v), code.spread(code.sum(v[-1]))], count)(rows)
    expected = rows.astype(np.float64).sum(axis=1)
    np.testing.assert_allclose(both[0, :count], expected, atol=1e-5)
    np.testing.assert_allclose(both[1], expected[-1], atol=1e-5)


def test_transposed_exchanges_lanes_and_numbers() -> None:
    rows = random((LANES, LANES))
    transposed = compiled(lambda code, *v: code.transposed(v), LANES)
    np.testing.assert_array_equal(transposed(rows), rows.T)
    np.testing.assert_array_equal(transposed(transposed(rows)), rows)


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
            x + y, x - y, x * y, x / y, -x, 2.0 + x, 2.0 - x, 2.0 / x, x * first, first - x,
            code.fma(x, y, 1.0), code.fma(x, first, y), code.with_lane(x, 5, first), code.spread(first),
        ]  # fmt: skip

    found = compiled(write, 2)(np.stack([a, b]))
    replaced = np.where(LANE == 5, b[0], a)
    expected = [
        a + b, a - b, a * b, a / b, -a, 2 + a, 2 - a, 2 / a, a * b[0], b[0] - a,
        a * b + 1, a * b[0] + b, replaced, np.full(LANES, b[0]),
    ]  # fmt: skip
    np.testing.assert_allclose(found, expected, rtol=5e-7)


def test_integers_shift_divide_and_become_floats() -> None:
    numbers = LANE * 37 - 300

    def write(code: Code) -> list[Value]:
        x = code.integers(numbers)
        return [
            x + 5, 5 - x, x * 3, x / 7, x >> 2, code.integers(1) << code.integers(LANE), x & 255, x | 1,
            code.to_integers(code.vector(numbers * 0.3)), code.select(x > 0, x, code.integers(-1)),
        ]  # fmt: skip

    found = as_int32(compiled(write, 0)(np.zeros((0, LANES))))
    expected = [
        numbers + 5, 5 - numbers, numbers * 3, np.trunc(numbers / 7), numbers >> 2, 1 << LANE, numbers & 255,
        numbers | 1, np.trunc(numbers * 0.3), np.where(numbers > 0, numbers, -1),
    ]  # fmt: skip
    np.testing.assert_array_equal(found, np.array(expected, np.int64))
    as_floats = compiled(lambda code: [code.to_floats(code.integers(numbers))], 0)(np.zeros((0, LANES)))
    np.testing.assert_array_equal(as_floats[0], numbers)


def scalar_results(write: Callable[..., list[Value]], *arguments: int) -> list[int]:
    """The int64 values that ``write(code, *scalars)`` lists."""
    written = 0

    @vector_kernel(void(int64, int64))
    def body(code, source, target):
        nonlocal written
        results = write(code, *(code.load_long(source + 8 * k) for k in range(len(arguments))))
        written = len(results)
        for k, result in enumerate(results):
            code.store_long(target + 8 * k, result)

    @numba.njit
    def call(source, target):
        body(source, target)

    source, target = np.array([*arguments, 0], np.int64), np.zeros(64, np.int64)
    call(source.ctypes.data, target.ctypes.data)
    return target[:written].tolist()


@pytest.mark.parametrize("count", [0, 1, 7, 15, 16])
def test_the_bits_of_a_mask_are_its_lanes(count: int) -> None:
    def write(code: Code, count: Value) -> list[Value]:
        mask = code.integers(range(LANES)) < code.to_int(count)
        return [code.bits(mask), code.bits(code.select(mask, 1.0, 0.0) > 0.5)]

    assert scalar_results(write, count) == [(1 << count) - 1] * 2


@pytest.mark.parametrize("bits", [0, 1, 2**63 - 1, 0b1011, 1 << 40, -1, -(2**63)])
def test_stages_are_done_in_order_for_each_set_bit(bits: int) -> None:
    @vector_kernel(void(int64, int64))
    def body(code, bits, target):
        count = code.variable(code.long(0))

        def finish(values):
            code.store_long(target + count.get() * 8, values[0])
            count.add(code.long(1))

        code.in_stages(bits, lambda bit: [bit, bit * 3], lambda x: [x[0] + x[1] * 100], finish)

    @numba.njit
    def call(bits, target):
        body(bits, target)

    found = np.full(65, -1, np.int64)
    call(bits, found.ctypes.data)
    expected = [301 * k for k in range(64) if bits >> k & 1]
    assert found[: len(expected)].tolist() == expected
    assert (found[len(expected) :] == -1).all()


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


def test_quarters_and_numbers_are_exchanged() -> None:
    @vector_kernel(void(int64))
    def body(code, vectors):
        rows = [code.load(vectors + VECTOR_BYTES * k) for k in range(4)]
        for k, row in enumerate(code.quarters_exchanged(rows)):
            code.store(vectors + VECTOR_BYTES * k, row)

    @numba.njit
    def call(vectors):
        body(vectors)

    vectors = aligned((4, LANES))
    vectors[:] = random((4, LANES))
    expected = vectors.reshape(4, 4, 4).swapaxes(0, 1).reshape(4, LANES).copy()
    call(vectors.ctypes.data)
    np.testing.assert_array_equal(vectors, expected)


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


def test_memory_is_aligned_and_zero() -> None:
    for shape, dtype in (((3, 5), np.float32), (7, np.uint8), ((0, 16), np.float32), ((2, 3, 4), np.uint64)):
        array = aligned(shape, dtype)
        assert array.dtype == dtype and array.shape == (shape if isinstance(shape, tuple) else (shape,))
        assert array.ctypes.data % VECTOR_BYTES == 0 or not array.size
        assert not array.any()


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="only x86 is told to flush")
def test_denormals_are_flushed_until_the_state_is_restored() -> None:
    @numba.njit
    def begin():
        return flush_denormals()

    @numba.njit(void(int32))
    def end(state):
        restore_denormals(state)

    def product() -> float:
        return float((np.full(3, 1e-30, np.float32) * np.float32(1e-10))[0])

    before = begin()
    try:
        flushed, inner = product(), begin()
        end(inner)
        still_flushed = product()
    finally:
        end(before)
    assert flushed == still_flushed == 0.0
    assert product() == pytest.approx(1e-40, rel=1e-4)
    again = begin()
    end(before)
    status_flags = 0x3F  # of past operations, not settings
    assert again & ~status_flags == before & ~status_flags


def test_the_coefficients_are_those_of_a_power_of_two() -> None:
    assert np.polyval(EXP2_COEFFICIENTS_BELOW_0, -1.0) == pytest.approx(0.5, rel=1e-6)
    assert EXP2_COEFFICIENTS_BELOW_0[-2] == pytest.approx(math.log(2.0), rel=1e-4)
