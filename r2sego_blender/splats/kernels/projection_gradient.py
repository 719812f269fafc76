"""The gradient of the projection, sixteen Gaussians at a time, and the step that follows it.

A Gaussian's sums over its pixels are gathered from its entries' slots; from them follow the
gradients of its parameters, which are either written out or used at once in a step of Adam
(Kingma and Ba 2015). Only Gaussians that were blended into the image take part, and each
has its own step count for the bias correction: one first seen late would else start with
steps six times too long.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace

from numba import get_thread_id
from numba.core.types import float32, int64, void

from ..harmonics import basis_gradients, basis_values
from ..vector_language.denormals import flush_denormals, restore_denormals
from ..vector_language.exponentials import exp2
from ..vector_language.lanes import lane_sums, transposed
from ..vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel
from .batches import SLOT_BYTES
from .blending_gradient import BLENDED
from .compiled import dealt, kernel, parallel_kernel, prange, turns
from .packing import HARMONICS, LOG_SCALE, LOGIT_OPACITY, MEAN, QUATERNION
from .projection import (
    BLOCK,
    FORM_SCALE,
    HEIGHT,
    WIDTH,
    Lens,
    cross,
    dot,
    ellipsoid_on_screen,
    factor,
    parameter,
    point_on_screen,
    sigmoid,
    unbounded_colour,
    view_direction,
    visible_colour,
)

GATHER_BYTES = LANES * SLOT_BYTES
POSE_SUMS = 6

BETA_1, BETA_2 = 0.9, 0.999
TINIEST_SQUARE = 1e-30  # added to the second moment, where torch adds 1e-15 to its root
_LOG2_BETA_1, _LOG2_BETA_2 = math.log2(BETA_1), math.log2(BETA_2)
_SHORT = 0.05  # below this, 1 - 2^-x is taken from its series: the difference would lose digits

_LARGEST_TURN = 1e12
"""Harmonics that pull a direction more than this are absurd: their gradient would overflow."""

_EXPONENT_SCALE = 8.0 * math.log(2.0)
"""dalpha / alpha for the exponent's eighth."""


@vector_kernel(void(int64, int64, int64))
def _add_slots(code: Code, first: Value, count: Value, total: Value) -> None:
    """The sum of a Gaussian's slots."""
    value = code.variable(code.vector(0.0))
    with code.loop(count) as i:
        value.add(code.load(first + i * SLOT_BYTES))
    code.store(total, value.get())


def _screen_gradients(a: Value, b: Value, c: Value, eighth: Value, sums: list[Value]) -> SimpleNamespace:
    """The gradients of the centre and of the covariance, from the moments of e and f."""
    e, f, ee, ef = sums[1:5]
    ff = eighth * sums[0] - sums[5] - ee
    centre, spread = 2.0 * _EXPONENT_SCALE, _EXPONENT_SCALE / FORM_SCALE
    return SimpleNamespace(
        u=a * e * centre,
        v=(b * e + c * f) * centre,
        xx=a * a * ee * spread,
        xy=2.0 * a * (b * ee + c * ef) * spread,
        yy=(b * b * ee + 2.0 * b * c * ef + c * c * ff) * spread,
    )


def _point_gradient(
    code: Code,
    at: SimpleNamespace,
    shape: SimpleNamespace,
    g: SimpleNamespace,
    g_x: list[Value],
    g_y: list[Value],
    g_depth: Value,
) -> list[Value]:
    """Of the camera point: through the centre, the linearised projection, and the depth."""
    (x, y), iz = (at.slope_x, at.slope_y), at.inverse_z
    jx, jy = shape.jacobian_x, shape.jacobian_y
    depths = [axis[2] for axis in shape.axes]
    by_held_x, by_held_y = -jx * dot(g_x, depths), -jy * dot(g_y, depths)
    free_x, free_y = x.equals(shape.held_x), y.equals(shape.held_y)
    by_held_x = code.select(free_x, by_held_x, 0.0)
    by_held_y = code.select(free_y, by_held_y, 0.0)
    # Both the Jacobian's first entries and the slopes fall with 1 / z.
    by_scale = dot(g_x, shape.row_x) + dot(g_y, shape.row_y)
    px = (jx * g.u) + by_held_x * iz
    py = (jy * g.v) + by_held_y * iz
    pz = g_depth - jx * x * g.u - jy * y * g.v - iz * (by_scale + by_held_x * x + by_held_y * y)
    return [px, py, pz]


def _quaternion_gradient(code: Code, shape: SimpleNamespace, g: list[list[Value]]) -> list[Value]:
    """From the gradient of the rotation matrix, to the quaternion before it is normalised."""
    w, x, y, z = shape.quaternion
    gw = 2.0 * (x * (g[2][1] - g[1][2]) + y * (g[0][2] - g[2][0]) + z * (g[1][0] - g[0][1]))
    gx = 2.0 * (
        -2.0 * x * (g[1][1] + g[2][2]) + y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0]) + w * (g[2][1] - g[1][2])
    )
    gy = 2.0 * (
        x * (g[0][1] + g[1][0]) - 2.0 * y * (g[0][0] + g[2][2]) + z * (g[1][2] + g[2][1]) + w * (g[0][2] - g[2][0])
    )
    gz = 2.0 * (
        x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1]) - 2.0 * z * (g[0][0] + g[1][1]) + w * (g[1][0] - g[0][1])
    )
    along = gw * w + gx * x + gy * y + gz * z
    # A quaternion of no length has no direction to turn in.
    length = code.select(shape.has_length, shape.inverse_norm, 0.0)
    return [(gq - along * q) * length for gq, q in zip((gw, gx, gy, gz), (w, x, y, z), strict=True)]


def _write_gradients(
    code: Code,
    chunk: Value,
    degree: Value,
    lens: Lens,
    gathered: Value,
    opacity_pull: Value,
    scale_pull: Value,
    emit: Callable[[int, Value], None],
) -> SimpleNamespace:
    """``emit(row, gradient)`` for each parameter; returns the gradients of ``pose`` and centre.

    The pose moves by a small rotation w and translation t of the camera frame,
    camera_from_world becoming exp(w, t) camera_from_world. The two pulls are the gradients
    of the sums of opacities and scales (metres) in the loss.
    """
    sums = transposed([code.load(gathered + SLOT_BYTES * k) for k in range(LANES)])
    at = point_on_screen(code, lens, chunk)
    shape = ellipsoid_on_screen(code, lens, chunk, at)
    a, b, c, _ = factor(code, shape)
    opacity, log2_opacity = sigmoid(code, parameter(code, chunk, LOGIT_OPACITY))
    g = _screen_gradients(a, b, c, log2_opacity * 0.125, sums)
    g_x = [2.0 * g.xx * shape.row_x[k] + g.xy * shape.row_y[k] for k in range(3)]
    g_y = [2.0 * g.yy * shape.row_y[k] + g.xy * shape.row_x[k] for k in range(3)]
    g_point = _point_gradient(code, at, shape, g, g_x, g_y, sums[9])

    # The ellipsoid's axes, in the camera frame and then in the world: R diag(scales).
    g_axes = [
        [
            shape.jacobian_x * g_x[k],
            shape.jacobian_y * g_y[k],
            -(shape.jacobian_x * shape.held_x * g_x[k]) - shape.jacobian_y * shape.held_y * g_y[k],
        ]
        for k in range(3)
    ]
    g_world = [lens.rotated_back(*g_axis) for g_axis in g_axes]
    for k in range(3):
        along = (dot(g_world[k], [shape.rotation[j][k] for j in range(3)]) + scale_pull) * shape.scales[k]
        emit(LOG_SCALE + k, code.select(shape.free[k], along, 0.0))
    g_rotation = [[g_world[k][j] * shape.scales[k] for k in range(3)] for j in range(3)]
    for k, gradient in enumerate(_quaternion_gradient(code, shape, g_rotation)):
        emit(QUATERNION + k, gradient)
    emit(LOGIT_OPACITY, (sums[0] + opacity_pull * opacity) * (1.0 - opacity))

    # Colour, and through the direction of view the mean once more.
    direction, inverse_distance = view_direction(code, lens, at.mean)
    colour = unbounded_colour(code, chunk, direction, degree)
    shown = [code.select(visible_colour(code, x).equals(x), sums[6 + k], 0.0) for k, x in enumerate(colour)]
    basis, slopes = basis_values(*direction), basis_gradients(*direction)
    turns = [code.variable(code.vector(0.0)) for _ in range(3)]
    for k in range(3):
        emit(HARMONICS + k, shown[k] * basis[0])
    for band in range(1, 4):
        with code.when(degree >= band):
            for k in range(band**2, (band + 1) ** 2):
                weight = dot(shown, [parameter(code, chunk, HARMONICS + 3 * k + j) for j in range(3)])
                weight = code.select(code.absolute(weight) < _LARGEST_TURN, weight, 0.0)
                for total, slope in zip(turns, slopes[k], strict=True):
                    if slope is not None:
                        total.add(weight * slope)
                for j in range(3):
                    emit(HARMONICS + 3 * k + j, shown[j] * basis[k])
    turn = [t.get() for t in turns]
    outward = dot(turn, direction)
    g_mean = lens.rotated_back(*g_point)
    g_mean = [g_mean[k] + (turn[k] - outward * direction[k]) * inverse_distance for k in range(3)]
    for k in range(3):
        emit(MEAN + k, g_mean[k])
    turning = [cross(at.point, g_point), *(cross(shape.axes[k], g_axes[k]) for k in range(3))]
    pose = [*(sum(parts[1:], parts[0]) for parts in zip(*turning, strict=True)), *lens.rotated(*g_mean)]
    return SimpleNamespace(pose=pose, u=g.u * (lens[WIDTH] * 0.5), v=g.v * (lens[HEIGHT] * 0.5))


def _blended(code: Code, gathered: Value) -> Value:
    """The lanes whose Gaussians were blended into the image."""
    flags = [code.load_float(gathered + SLOT_BYTES * k + 4 * BLENDED) for k in range(LANES)]
    vector = code.vector(0.0)
    for k, flag in enumerate(flags):
        vector = code.with_lane(vector, k, flag)
    return vector > 0.5


def _store_pose_gradient(code: Code, pose: list[Value], blended: Value, address: Value) -> None:
    code.store(address, lane_sums([code.select(blended, p, 0.0) for p in pose]))


@vector_kernel(void(int64, int64, int64, int64, int64, int64))
def _store_gradients(
    code: Code, chunk: Value, degree: Value, lens: Value, gathered: Value, gradients: Value, pose: Value
) -> None:
    """Write a chunk's gradients, 0 for Gaussians that were not blended."""
    blended = _blended(code, gathered)

    def emit(row: int, gradient: Value) -> None:
        code.store(gradients + VECTOR_BYTES * row, code.select(blended, gradient, 0.0))

    none = code.float(0.0)
    moved = _write_gradients(code, chunk, degree, Lens.load(code, lens), gathered, none, none, emit)
    _store_pose_gradient(code, moved.pose, blended, pose)


def _one_minus_power(code: Code, log2_base: float, steps: Value) -> Value:
    """1 - base ** steps."""
    exponent = steps * log2_base
    x = exponent * math.log(2.0)
    series = -x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0))))
    direct = 1.0 - exp2(code.maximum(exponent, -100.0))
    return code.select(x > -_SHORT, series, direct)


@vector_kernel(void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, float32, float32, int64))
def _adam_chunk(
    code: Code,
    chunk: Value,
    chunk_bytes: Value,
    degree: Value,
    lens: Value,
    gathered: Value,
    first: Value,
    second: Value,
    steps: Value,
    statistics: Value,
    rates: Value,
    opacity_pull: Value,
    scale_pull: Value,
    pose: Value,
) -> None:
    """One step of a chunk's blended Gaussians; ``rates`` has a float for each row.

    ``statistics`` (2, 16) adds up the centres' gradients, in half images as 3DGS measures
    them, and the images.
    """
    blended = _blended(code, gathered)
    count = code.load(steps) + code.select(blended, 1.0, 0.0)
    code.store(steps, count)
    count = code.maximum(count, 1.0)
    correction = code.sqrt(_one_minus_power(code, _LOG2_BETA_2, count))
    correction = correction / _one_minus_power(code, _LOG2_BETA_1, count)

    def emit(row: int, gradient: Value) -> None:
        offset = VECTOR_BYTES * row
        old_m, old_v, value = (code.load(x + offset) for x in (first, second, chunk))
        m = old_m * BETA_1 + gradient * (1.0 - BETA_1)
        v = old_v * BETA_2 + gradient * gradient * (1.0 - BETA_2)
        step = correction * m * (1.0 / code.sqrt(v + TINIEST_SQUARE))
        moved = value - code.load_float(rates + 4 * row) * step
        for place, new, old in ((first, m, old_m), (second, v, old_v), (chunk, moved, value)):
            code.store(place + offset, code.select(blended, new, old))
            code.prefetch(place + chunk_bytes + offset, write=True)  # of the next chunk

    moved = _write_gradients(code, chunk, degree, Lens.load(code, lens), gathered, opacity_pull, scale_pull, emit)
    _store_pose_gradient(code, moved.pose, blended, pose)
    shift = code.sqrt(moved.u * moved.u + moved.v * moved.v)
    for row, term in enumerate((shift, code.vector(1.0))):
        place = statistics + VECTOR_BYTES * row
        code.store(place, code.load(place) + code.select(blended, term, 0.0))


@vector_kernel(int64(int64, int64))
def _any_blended(code: Code, gathered: Value, visible: Value) -> Value:
    """Whether a visible lane has been blended."""
    total = code.variable(code.float(0.0))
    with code.loop_bits(visible) as lane:
        total.add(code.load_float(gathered + lane * SLOT_BYTES + 4 * BLENDED))
    return code.select(total.get() > 0.5, code.long(1), code.long(0))


@vector_kernel(void(int64, int64))
def _clear(code: Code, address: Value, size: Value) -> None:
    with code.loop(size >> 6) as i:
        code.store(address + i * VECTOR_BYTES, code.vector(0.0))


@kernel
def _gather(bits, chunk, starts, counts, slots, gathered):
    """The sums of a chunk's visible Gaussians; whether one was blended."""
    _clear(gathered, GATHER_BYTES)
    for lane in range(LANES):
        if bits >> lane & 1:
            i = chunk * LANES + lane
            _add_slots(slots + starts[i] * SLOT_BYTES, counts[i], gathered + lane * SLOT_BYTES)
    return _any_blended(gathered, bits) != 0


@parallel_kernel
def project_backward(
    chunks, count, chunk_bytes, degree, lens, visible, starts, counts, slots, scratch, gradients, pose, threads
):
    """Fill ``gradients``, chunks as ``chunks``, and ``pose``, a vector a chunk; all addresses.

    Chunks of which nothing was blended get zeros.
    """
    each = turns((count + BLOCK - 1) // BLOCK, 1, threads)
    for number in prange(each * threads):
        block = dealt(number, each, 1, threads)
        state = flush_denormals()
        gathered = scratch + get_thread_id() * GATHER_BYTES
        for i in range(block * BLOCK, min(count, (block + 1) * BLOCK)):
            at = i * chunk_bytes
            if visible[i] and _gather(visible[i], i, starts, counts, slots, gathered):
                _store_gradients(chunks + at, degree, lens, gathered, gradients + at, pose + i * VECTOR_BYTES)
            else:
                _clear(gradients + at, chunk_bytes)
                _clear(pose + i * VECTOR_BYTES, VECTOR_BYTES)
        restore_denormals(state)


@parallel_kernel
def project_backward_adam(
    chunks,
    count,
    chunk_bytes,
    degree,
    lens,
    visible,
    starts,
    counts,
    slots,
    scratch,
    first,
    second,
    steps,
    statistics,
    rates,
    opacity_pull,
    scale_pull,
    pose,
    threads,
):
    """The same with a step of Adam in place of the gradients.

    ``first`` and ``second`` are the moments, chunks as ``chunks``; ``steps`` a vector a chunk,
    ``statistics`` two.
    """
    each = turns((count + BLOCK - 1) // BLOCK, 1, threads)
    for number in prange(each * threads):
        block = dealt(number, each, 1, threads)
        state = flush_denormals()
        gathered = scratch + get_thread_id() * GATHER_BYTES
        for i in range(block * BLOCK, min(count, (block + 1) * BLOCK)):
            at, row = i * chunk_bytes, i * VECTOR_BYTES
            if visible[i] and _gather(visible[i], i, starts, counts, slots, gathered):
                _adam_chunk(
                    chunks + at,
                    chunk_bytes,
                    degree,
                    lens,
                    gathered,
                    first + at,
                    second + at,
                    steps + row,
                    statistics + 2 * row,
                    rates,
                    opacity_pull,
                    scale_pull,
                    pose + row,
                )
            else:
                _clear(pose + row, VECTOR_BYTES)
        restore_denormals(state)
