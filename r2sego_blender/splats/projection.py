"""Projection of Gaussians to the screen (EWA splatting, as 3DGS) and its gradient.

The kernels work on one Gaussian a time in float32. A projected Gaussian is a row of
``SCREEN_COLUMNS`` numbers: centre (u, v) in pixels; the quadratic form A, B, C with
log2(alpha) = LOG2_OPACITY - A dx^2 - B dx dy - C dy^2; colour; planar depth in metres;
half extents in pixels of the ellipse outside which alpha is below 1/255.
"""

from __future__ import annotations

import math

import numpy as np

from ..cameras import Camera
from .compiled import inlined, kernel, parallel_kernel, prange
from .harmonics import direction_gradient, evaluate_basis

U, V, QUAD_A, QUAD_B, QUAD_C, LOG2_OPACITY, RED, GREEN, BLUE, DEPTH, EXTENT_X, EXTENT_Y = range(12)
SCREEN_COLUMNS = 12

MOMENT_COLUMNS = 10
"""Gradient sums of a Gaussian over pixels: of d = alpha * dL/dalpha the moments 1, dx, dy,
dx^2, dx dy, dy^2; and the gradients of red, green, blue and depth."""

PARTS = 16
"""Kernels split their work into this many interleaved parts: enough to share it evenly."""

NEAREST_M = np.float32(0.2)
"""Gaussians nearer than this to the camera plane are not drawn, as in 3DGS."""

DILATION_PX2 = np.float32(0.3)
"""Added to the screen-space variances, as in 3DGS."""

SMALLEST_ALPHA = 1.0 / 255.0
LARGEST_ALPHA = 0.99

_BLOCK = 256
_0, _1, _2, _4 = np.float32(0), np.float32(1), np.float32(2), np.float32(4)
_HALF = np.float32(0.5)
_LN2 = np.float32(math.log(2.0))
_LOG2E = np.float32(1.0 / math.log(2.0))
_LOG2_SMALLEST_ALPHA = np.float32(math.log2(SMALLEST_ALPHA))
_TINY = np.float32(1e-20)
_LARGEST_LOGIT = np.float32(60)
_LARGEST_LOG_SCALE = np.float32(12)
_LARGEST_VARIANCE_PX2 = np.float32(1e14)

# The lens array: camera_from_world rotation (row-major) and translation, centre,
# focal lengths, principal point, size, and the bounds of x/z and y/z beyond which the
# linearised projection is held (as in 3DGS: 30 % of the field of view outside the image).
_TRANSLATION, _CENTRE, _FX, _FY, _CX, _CY, _WIDTH, _HEIGHT, _BOUNDS = 9, 12, 15, 16, 17, 18, 19, 20, 21


def lens_of(camera: Camera) -> np.ndarray:
    """The camera as the (25,) float32 array the kernels read."""
    transform = camera.camera_from_world
    margin_x = 0.15 * camera.width / camera.fx
    margin_y = 0.15 * camera.height / camera.fy
    return np.concatenate(
        [
            transform[:3, :3].ravel(),
            transform[:3, 3],
            camera.centre,
            [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height],
            [-camera.cx / camera.fx - margin_x, (camera.width - camera.cx) / camera.fx + margin_x],
            [-camera.cy / camera.fy - margin_y, (camera.height - camera.cy) / camera.fy + margin_y],
        ]
    ).astype(np.float32)


@inlined
def _rotation(quaternions, i):
    """The rotation matrix (9 numbers, row-major), the unit quaternion, and 1 / its length."""
    w, x, y, z = quaternions[i, 0], quaternions[i, 1], quaternions[i, 2], quaternions[i, 3]
    inverse_norm = _1 / math.sqrt(w * w + x * x + y * y + z * z + _TINY)
    w, x, y, z = w * inverse_norm, x * inverse_norm, y * inverse_norm, z * inverse_norm
    matrix = (
        _1 - _2 * (y * y + z * z), _2 * (x * y - w * z), _2 * (x * z + w * y),
        _2 * (x * y + w * z), _1 - _2 * (x * x + z * z), _2 * (y * z - w * x),
        _2 * (x * z - w * y), _2 * (y * z + w * x), _1 - _2 * (x * x + y * y),
    )  # fmt: skip
    return matrix, (w, x, y, z), inverse_norm


@inlined
def _camera_point(lens, means, i):
    x, y, z = means[i, 0], means[i, 1], means[i, 2]
    return (
        lens[0] * x + lens[1] * y + lens[2] * z + lens[_TRANSLATION],
        lens[3] * x + lens[4] * y + lens[5] * z + lens[_TRANSLATION + 1],
        lens[6] * x + lens[7] * y + lens[8] * z + lens[_TRANSLATION + 2],
    )


@inlined
def _scales(log_scales, i):
    return (
        math.exp(min(log_scales[i, 0], _LARGEST_LOG_SCALE)),
        math.exp(min(log_scales[i, 1], _LARGEST_LOG_SCALE)),
        math.exp(min(log_scales[i, 2], _LARGEST_LOG_SCALE)),
    )


@inlined
def _axes_in_camera(lens, r, s):
    """camera_from_world @ R @ diag(s): the ellipsoid's axes, 9 numbers row-major."""
    return (
        (lens[0] * r[0] + lens[1] * r[3] + lens[2] * r[6]) * s[0],
        (lens[0] * r[1] + lens[1] * r[4] + lens[2] * r[7]) * s[1],
        (lens[0] * r[2] + lens[1] * r[5] + lens[2] * r[8]) * s[2],
        (lens[3] * r[0] + lens[4] * r[3] + lens[5] * r[6]) * s[0],
        (lens[3] * r[1] + lens[4] * r[4] + lens[5] * r[7]) * s[1],
        (lens[3] * r[2] + lens[4] * r[5] + lens[5] * r[8]) * s[2],
        (lens[6] * r[0] + lens[7] * r[3] + lens[8] * r[6]) * s[0],
        (lens[6] * r[1] + lens[7] * r[4] + lens[8] * r[7]) * s[1],
        (lens[6] * r[2] + lens[7] * r[5] + lens[8] * r[8]) * s[2],
    )


@inlined
def _screen_axes(lens, point, axes):
    """The Jacobian (xx, xz, yy, yz), the held x/z and y/z, and the axes' images in pixels."""
    inverse_z = _1 / point[2]
    held_x = min(max(point[0] * inverse_z, lens[_BOUNDS]), lens[_BOUNDS + 1])
    held_y = min(max(point[1] * inverse_z, lens[_BOUNDS + 2]), lens[_BOUNDS + 3])
    xx, yy = lens[_FX] * inverse_z, lens[_FY] * inverse_z
    xz, yz = -xx * held_x, -yy * held_y
    row_x = (xx * axes[0] + xz * axes[6], xx * axes[1] + xz * axes[7], xx * axes[2] + xz * axes[8])
    row_y = (yy * axes[3] + yz * axes[6], yy * axes[4] + yz * axes[7], yy * axes[5] + yz * axes[8])
    return (xx, xz, yy, yz), (held_x, held_y), row_x, row_y


@inlined
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _sum(s, a, t, b):
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@inlined
def _view_direction(lens, means, i):
    x, y, z = means[i, 0] - lens[_CENTRE], means[i, 1] - lens[_CENTRE + 1], means[i, 2] - lens[_CENTRE + 2]
    inverse_norm = _1 / math.sqrt(x * x + y * y + z * z + _TINY)
    return x * inverse_norm, y * inverse_norm, z * inverse_norm, inverse_norm


@kernel
def _project_one(i, means, log_scales, quaternions, logit_opacities, sh, coefficients, lens, basis, screen):
    """Write row ``i`` of ``screen``; False when the Gaussian cannot show in the image."""
    point = _camera_point(lens, means, i)
    if not (point[2] > NEAREST_M and point[2] < _LARGEST_VARIANCE_PX2):
        return False
    logit = min(max(logit_opacities[i], -_LARGEST_LOGIT), _LARGEST_LOGIT)
    log2_opacity = -math.log1p(math.exp(-logit)) * _LOG2E
    reach = log2_opacity - _LOG2_SMALLEST_ALPHA
    if not reach > _0:
        return False
    rotation, _, _ = _rotation(quaternions, i)
    axes = _axes_in_camera(lens, rotation, _scales(log_scales, i))
    _, _, row_x, row_y = _screen_axes(lens, point, axes)
    a = _dot(row_x, row_x) + DILATION_PX2
    b = _dot(row_x, row_y)
    c = _dot(row_y, row_y) + DILATION_PX2
    determinant = a * c - b * b
    if not (determinant > _0 and a < _LARGEST_VARIANCE_PX2 and c < _LARGEST_VARIANCE_PX2):
        return False
    u = lens[_FX] * point[0] / point[2] + lens[_CX]
    v = lens[_FY] * point[1] / point[2] + lens[_CY]
    extent_x = math.sqrt(_2 * _LN2 * reach * a)
    extent_y = math.sqrt(_2 * _LN2 * reach * c)
    inside_x = u + extent_x > _HALF and u - extent_x < lens[_WIDTH] - _HALF
    inside_y = v + extent_y > _HALF and v - extent_y < lens[_HEIGHT] - _HALF
    if not (inside_x and inside_y):
        return False
    x, y, z, _ = _view_direction(lens, means, i)
    evaluate_basis(x, y, z, coefficients, basis)
    red, green, blue = _HALF, _HALF, _HALF
    for k in range(coefficients):
        red += basis[k] * sh[i, k, 0]
        green += basis[k] * sh[i, k, 1]
        blue += basis[k] * sh[i, k, 2]
    scale = _HALF * _LOG2E / determinant
    screen[i, U] = u
    screen[i, V] = v
    screen[i, QUAD_A] = c * scale
    screen[i, QUAD_B] = -_2 * b * scale
    screen[i, QUAD_C] = a * scale
    screen[i, LOG2_OPACITY] = log2_opacity
    screen[i, RED] = max(red, _0)
    screen[i, GREEN] = max(green, _0)
    screen[i, BLUE] = max(blue, _0)
    screen[i, DEPTH] = point[2]
    screen[i, EXTENT_X] = extent_x
    screen[i, EXTENT_Y] = extent_y
    return True


@parallel_kernel
def project(means, log_scales, quaternions, logit_opacities, sh, coefficients, lens, screen, visible):
    """Fill ``screen`` (N, 12) float32 and ``visible`` (N,) bool; hidden rows are left as they are."""
    count = means.shape[0]
    blocks = (count + _BLOCK - 1) // _BLOCK
    for part in prange(PARTS):
        basis = np.empty(16, np.float32)
        for block in range(part, blocks, PARTS):
            for i in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
                visible[i] = _project_one(
                    i, means, log_scales, quaternions, logit_opacities, sh, coefficients, lens, basis, screen
                )


@inlined
def _variance_gradients(row, moments):
    """The gradients of the variances a, c and covariance b from the second moments."""
    scale = _2 * _LN2
    conic_a, conic_b, conic_c = row[QUAD_A] * scale, row[QUAD_B] * scale * _HALF, row[QUAD_C] * scale
    ga, gb, gc = -_HALF * moments[3], -_HALF * moments[4], -_HALF * moments[5]
    return (
        -(conic_a * conic_a * ga + _2 * conic_a * conic_b * gb + conic_b * conic_b * gc),
        -_2
        * (conic_a * conic_b * ga + (conic_a * conic_c + conic_b * conic_b) * gb + conic_b * conic_c * gc),
        -(conic_b * conic_b * ga + _2 * conic_b * conic_c * gb + conic_c * conic_c * gc),
    )


@kernel
def _backward_one(
    i, row, moments, means, log_scales, quaternions, logit_opacities, sh, coefficients, lens, basis, weights,
    mean_gradients, scale_gradients, quaternion_gradients, logit_gradients, sh_gradients,
):  # fmt: skip
    """Write row ``i`` of every gradient from the sums over its pixels."""
    point = _camera_point(lens, means, i)
    rotation, (w, x, y, z), inverse_norm = _rotation(quaternions, i)
    scales = _scales(log_scales, i)
    axes = _axes_in_camera(lens, rotation, scales)
    (xx, xz, yy, yz), (held_x, held_y), row_x, row_y = _screen_axes(lens, point, axes)
    gu = _LN2 * (_2 * row[QUAD_A] * moments[1] + row[QUAD_B] * moments[2])
    gv = _LN2 * (row[QUAD_B] * moments[1] + _2 * row[QUAD_C] * moments[2])
    ga, gb, gc = _variance_gradients(row, moments)
    gx = _sum(_2 * ga, row_x, gb, row_y)
    gy = _sum(_2 * gc, row_y, gb, row_x)

    # The point in the camera frame, through the centre, the Jacobian, and the depth channel.
    g_xx, g_xz = _dot(gx, axes[0:3]), _dot(gx, axes[6:9])
    g_yy, g_yz = _dot(gy, axes[3:6]), _dot(gy, axes[6:9])
    inverse_z = _1 / point[2]
    free_x = held_x == point[0] * inverse_z
    free_y = held_y == point[1] * inverse_z
    px = xx * gu
    py = yy * gv
    pz = moments[9] - xx * point[0] * inverse_z * gu - yy * point[1] * inverse_z * gv
    pz += inverse_z * (xx * (held_x * g_xz - g_xx) + yy * (held_y * g_yz - g_yy))
    if free_x:
        px -= xx * inverse_z * g_xz
        pz += xx * inverse_z * held_x * g_xz
    if free_y:
        py -= yy * inverse_z * g_yz
        pz += yy * inverse_z * held_y * g_yz

    # The axes in the camera frame, then in the world: R diag(s).
    camera_axes = (
        xx * gx[0], xx * gx[1], xx * gx[2],
        yy * gy[0], yy * gy[1], yy * gy[2],
        xz * gx[0] + yz * gy[0], xz * gx[1] + yz * gy[1], xz * gx[2] + yz * gy[2],
    )  # fmt: skip
    world_axes = (
        lens[0] * camera_axes[0] + lens[3] * camera_axes[3] + lens[6] * camera_axes[6],
        lens[0] * camera_axes[1] + lens[3] * camera_axes[4] + lens[6] * camera_axes[7],
        lens[0] * camera_axes[2] + lens[3] * camera_axes[5] + lens[6] * camera_axes[8],
        lens[1] * camera_axes[0] + lens[4] * camera_axes[3] + lens[7] * camera_axes[6],
        lens[1] * camera_axes[1] + lens[4] * camera_axes[4] + lens[7] * camera_axes[7],
        lens[1] * camera_axes[2] + lens[4] * camera_axes[5] + lens[7] * camera_axes[8],
        lens[2] * camera_axes[0] + lens[5] * camera_axes[3] + lens[8] * camera_axes[6],
        lens[2] * camera_axes[1] + lens[5] * camera_axes[4] + lens[8] * camera_axes[7],
        lens[2] * camera_axes[2] + lens[5] * camera_axes[5] + lens[8] * camera_axes[8],
    )  # fmt: skip
    for k in range(3):
        inside = log_scales[i, k] < _LARGEST_LOG_SCALE
        gradient = (
            world_axes[k] * rotation[k]
            + world_axes[3 + k] * rotation[3 + k]
            + world_axes[6 + k] * rotation[6 + k]
        )
        scale_gradients[i, k] = gradient * scales[k] if inside else _0
    g00, g01, g02 = world_axes[0] * scales[0], world_axes[1] * scales[1], world_axes[2] * scales[2]
    g10, g11, g12 = world_axes[3] * scales[0], world_axes[4] * scales[1], world_axes[5] * scales[2]
    g20, g21, g22 = world_axes[6] * scales[0], world_axes[7] * scales[1], world_axes[8] * scales[2]
    gw = _2 * (x * (g21 - g12) + y * (g02 - g20) + z * (g10 - g01))
    gqx = _2 * (-_2 * x * (g11 + g22) + y * (g01 + g10) + z * (g02 + g20) + w * (g21 - g12))
    gqy = _2 * (x * (g01 + g10) - _2 * y * (g00 + g22) + z * (g12 + g21) + w * (g02 - g20))
    gqz = _2 * (x * (g02 + g20) + y * (g12 + g21) - _2 * z * (g00 + g11) + w * (g10 - g01))
    along = gw * w + gqx * x + gqy * y + gqz * z
    # A quaternion of no length has no direction to turn in.
    inverse_norm = inverse_norm if inverse_norm * inverse_norm * _TINY < _HALF else _0
    quaternion_gradients[i, 0] = (gw - along * w) * inverse_norm
    quaternion_gradients[i, 1] = (gqx - along * x) * inverse_norm
    quaternion_gradients[i, 2] = (gqy - along * y) * inverse_norm
    quaternion_gradients[i, 3] = (gqz - along * z) * inverse_norm

    logit = logit_opacities[i]
    free = logit > -_LARGEST_LOGIT and logit < _LARGEST_LOGIT
    logit_gradients[i] = moments[0] / (_1 + math.exp(logit)) if free else _0

    red = moments[6] if row[RED] > _0 else _0
    green = moments[7] if row[GREEN] > _0 else _0
    blue = moments[8] if row[BLUE] > _0 else _0
    dx, dy, dz, inverse_distance = _view_direction(lens, means, i)
    evaluate_basis(dx, dy, dz, coefficients, basis)
    for k in range(coefficients):
        weights[k] = red * sh[i, k, 0] + green * sh[i, k, 1] + blue * sh[i, k, 2]
        sh_gradients[i, k, 0] = red * basis[k]
        sh_gradients[i, k, 1] = green * basis[k]
        sh_gradients[i, k, 2] = blue * basis[k]
    ex, ey, ez = direction_gradient(dx, dy, dz, coefficients, weights)
    outward = ex * dx + ey * dy + ez * dz
    mean_gradients[i, 0] = lens[0] * px + lens[3] * py + lens[6] * pz + (ex - outward * dx) * inverse_distance
    mean_gradients[i, 1] = lens[1] * px + lens[4] * py + lens[7] * pz + (ey - outward * dy) * inverse_distance
    mean_gradients[i, 2] = lens[2] * px + lens[5] * py + lens[8] * pz + (ez - outward * dz) * inverse_distance


@parallel_kernel
def project_backward(
    ranks, offsets, counts, slots,
    means, log_scales, quaternions, logit_opacities, sh, coefficients, lens, screen,
    mean_gradients, scale_gradients, quaternion_gradients, logit_gradients, sh_gradients, touched,
):  # fmt: skip
    """Gradients of the parameters from the (Gaussian, tile) sums in ``slots`` (E, 10).

    ``ranks`` (N,) int32 is the place in the depth order, -1 when hidden; ``offsets`` and
    ``counts`` say by rank where a Gaussian's slots are; they are added up in that order.
    Rows of Gaussians without any gradient are left alone and ``touched`` (N,) is False.
    Only the first ``coefficients`` harmonics are written.
    """
    count = means.shape[0]
    blocks = (count + _BLOCK - 1) // _BLOCK
    for part in prange(PARTS):
        basis = np.empty(16, np.float32)
        weights = np.empty(16, np.float32)
        moments = np.empty(MOMENT_COLUMNS, np.float32)
        for block in range(part, blocks, PARTS):
            for i in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
                rank = ranks[i]
                some = False
                if rank >= 0:
                    moments[:] = _0
                    start = offsets[rank]
                    for entry in range(start, start + counts[rank]):
                        for k in range(MOMENT_COLUMNS):
                            moments[k] += slots[entry, k]
                    for k in range(MOMENT_COLUMNS):
                        some = some or moments[k] != _0
                touched[i] = some
                if some:
                    _backward_one(
                        i, screen[i], moments,
                        means, log_scales, quaternions, logit_opacities, sh, coefficients, lens,
                        basis, weights,
                        mean_gradients, scale_gradients, quaternion_gradients, logit_gradients, sh_gradients,
                    )  # fmt: skip
