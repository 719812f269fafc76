"""The matching cost of slanted-plane stereo: weighted NCC and the reprojection error.

Kept apart from the search over planes (``patchmatch``), of which it is the inner loop.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ...core.compiled import KernelDecorator
from ...core.compiled import kernel as plain_kernel

# Divisions without Python's check for zero, which would keep the sums out of vectors.
# Helpers are inlined by LLVM and take arrays, never tuples of them: Numba counts a
# reference for each array of a tuple it passes on, which costs more than a matching cost.
inner_kernel: KernelDecorator = functools.partial(plain_kernel, error_model="numpy", forceinline=True)
"""A helper of the stereo kernels."""

WORST_COST = np.float32(2.0)
"""The cost of a hypothesis that cannot be matched; 1 - NCC is never above it."""

NEAREST = np.float32(1e-3)
"""The least ratio of a point's depths in two cameras for it to lie in front of both."""

ZERO = np.float32(0.0)
# Added to the variance of a patch, (grey level 0..1)^2: a noise of half an 8-bit step.
_VARIANCE_NOISE = np.float32(4e-6)
# The difference in tone (0..1) at which a sample's weight has fallen to 1/e.
_TONAL_SPREAD = 0.05
# Pixels beyond which a reprojection error says no more (ACMM).
_MAX_REPROJECTION_PX = np.float32(3.0)


class Window(NamedTuple):
    """The samples of a matching window and how they are weighted.

    ``offsets`` (2, n) float32 whole du and dv in pixels, the uppermost sample's first; n is
    a multiple of 16 so that the sums run in whole vectors; ``spatial`` (n,) float32 the
    weight of each by distance, 0 for the samples that only pad; ``tonal`` (256,) float32
    the weight by difference in tone, grey or opponent colour, in 8-bit steps.
    """

    offsets: np.ndarray
    spatial: np.ndarray
    tonal: np.ndarray


class Reference(NamedTuple):
    """The capture whose planes are estimated.

    ``grey`` (H, W) float32 in [0, 1] is what is matched; ``opponent`` (2, H, W) float32 in [-1, 1], its red less
    green and yellow less blue, tells apart what is equally bright and only weighs the samples. ``lens`` (6,) float32
    fx, fy, cx, cy and the least and greatest inverse depth, 1/m.
    """

    grey: np.ndarray
    opponent: np.ndarray
    lens: np.ndarray


class Sources(NamedTuple):
    """The S captures a reference is matched against, flattened one after the other.

    ``texels`` (T,) uint32, see ``pack_texels``; ``layout`` (S, 3) int32 start, width and
    height of each; ``to_source`` (S, 3, 4) float32, the infinite homography and the
    epipole: reference pixel (u, v) at inverse depth w lies at ``to_source @ (u, v, 1, w)``
    in homogeneous source pixels, whose third component is the ratio of the depths;
    ``to_reference`` the same the other way; ``planes`` (T, 3) float32 the sources' own
    planes for the geometric term, which enters with ``geometric_weight`` (0: photometric
    only) a pixel of reprojection error.
    """

    texels: np.ndarray
    layout: np.ndarray
    to_source: np.ndarray
    to_reference: np.ndarray
    planes: np.ndarray
    geometric_weight: np.float32


def window(radius_px: int, stride_px: int = 2) -> Window:
    """The rounded window of the given half width, sampled every ``stride_px`` pixels."""
    steps = np.arange(-radius_px, radius_px + 1, stride_px)
    steps += (radius_px - steps[-1]) // 2  # as many beside the pixel on either hand
    dv, du = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    # A quarter over the half width: what is left of 6 x 6 samples is 32, no padding.
    rounded = np.hypot(du, dv) <= 1.25 * radius_px
    offsets = np.stack([du, dv])[:, rounded].astype(np.float32)
    padding = -offsets.shape[1] % 16
    spatial = np.exp(-(offsets**2).sum(axis=0) / (2.0 * radius_px**2)).astype(np.float32)
    tonal = np.exp(-np.arange(256) / 255.0 / _TONAL_SPREAD).astype(np.float32)
    offsets = np.ascontiguousarray(np.pad(offsets, ((0, 0), (0, padding))))
    return Window(offsets, np.pad(spatial, (0, padding)), tonal)


def pack_texels(grey: np.ndarray) -> np.ndarray:
    """(H, W) float grey in [0, 1] as (H * W,) uint32: in each entry the pixel and its
    neighbours to the right, below and below right, 8 bits each from the lowest. So a
    bilinear sample is one load; the last row and column hold no whole cell."""
    eight_bit = (np.clip(grey, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint32)
    texels = np.zeros(grey.shape, np.uint32)
    texels[:-1, :-1] = (
        eight_bit[:-1, :-1] | eight_bit[:-1, 1:] << 8 | eight_bit[1:, :-1] << 16 | eight_bit[1:, 1:] << 24
    )
    return texels.ravel()


@inner_kernel()
def weigh_patch(grey, opponent, offsets, spatial, tonal, x, y, patch):
    """Fill ``patch`` (2, n): the samples' weights, which sum to 1, and the weights times
    the grey less its weighted mean; give the weighted variance of the grey."""
    height, width = grey.shape
    centre, centre_rg, centre_yb = grey[y, x], opponent[0, y, x], opponent[1, y, x]
    total = mean = variance = ZERO
    for k in range(offsets.shape[1]):
        u, v = x + np.int32(offsets[0, k]), y + np.int32(offsets[1, k])
        row, column = np.uint64(min(max(v, 0), height - 1)), np.uint64(min(max(u, 0), width - 1))
        value = grey[row, column]
        colour = max(abs(opponent[0, row, column] - centre_rg), abs(opponent[1, row, column] - centre_yb))
        apart = max(abs(value - centre), colour)
        tone = np.uint64(min(np.int32(apart * np.float32(255.0) + np.float32(0.5)), 255))  # type: ignore[arg-type]  # of a kernel
        weight = spatial[k] * tonal[tone] * np.float32((row == v) & (column == u))
        patch[0, k] = weight
        patch[1, k] = value
        total += weight
        mean += weight * value
    mean /= total
    for k in range(offsets.shape[1]):
        weight = patch[0, k] / total
        difference = patch[1, k] - mean
        patch[0, k] = weight
        patch[1, k] = weight * difference
        variance += weight * difference * difference
    return variance


@inner_kernel()
def photometric_cost(texels, layout, to_source, offsets, s, x, y, a, b, c, patch, variance):
    """1 - NCC in [0, 2] between the patch at pixel (x, y) and source ``s`` through the
    homography of the plane ``(a, b, c)``; WORST_COST when the patch leaves the source."""
    first, source_width = layout[s, 0], layout[s, 1]
    right = np.float32(source_width) - np.float32(1.001)
    below = np.float32(layout[s, 2]) - np.float32(1.001)
    m = to_source
    h00, h01, h02 = m[s, 0, 0] + m[s, 0, 3] * a, m[s, 0, 1] + m[s, 0, 3] * b, m[s, 0, 2] + m[s, 0, 3] * c
    h10, h11, h12 = m[s, 1, 0] + m[s, 1, 3] * a, m[s, 1, 1] + m[s, 1, 3] * b, m[s, 1, 2] + m[s, 1, 3] * c
    h20, h21, h22 = m[s, 2, 0] + m[s, 2, 3] * a, m[s, 2, 1] + m[s, 2, 3] * b, m[s, 2, 2] + m[s, 2, 3] * c
    half = np.float32(0.5)
    u, v = np.float32(x) + half, np.float32(y) + half
    z0 = h20 * u + h21 * v + h22
    # Texel coordinates: a texel's first value lies at its pixel's centre.
    x0 = h00 * u + h01 * v + h02 - half * z0
    y0 = h10 * u + h11 * v + h12 - half * z0
    xu, xv = h00 - half * h20, h01 - half * h21
    yu, yv = h10 - half * h20, h11 - half * h21

    # A homography keeps the window convex, so its corners say whether all of it is inside.
    inside = True
    radius = -offsets[1, 0]
    for corner in range(4):
        du = radius if corner & 1 else -radius
        dv = radius if corner & 2 else -radius
        z = z0 + h20 * du + h21 * dv
        px = x0 + xu * du + xv * dv
        py = y0 + yu * du + yv * dv
        inside &= (z > NEAREST) & (min(px, py) >= ZERO) & (px <= right * z) & (py <= below * z)

    cost = WORST_COST
    if inside:
        total = squares = covariance = ZERO
        for k in range(offsets.shape[1]):
            du, dv = offsets[0, k], offsets[1, k]
            scale = np.float32(1.0) / (z0 + h20 * du + h21 * dv)
            px = (x0 + xu * du + xv * dv) * scale
            py = (y0 + yu * du + yv * dv) * scale
            ix, iy = np.int32(px), np.int32(py)
            fx, fy = px - np.float32(ix), py - np.float32(iy)
            # 32 bits and no sign: the form of an index that LLVM gathers in whole vectors.
            index = np.uint32(np.int32(first + iy * source_width + ix)) & np.uint32(0x7FFFFFFF)
            texel = texels[np.uint64(index)]
            q00 = np.float32(np.int32(texel & np.uint32(255)))
            q01 = np.float32(np.int32((texel >> np.uint32(8)) & np.uint32(255)))
            q10 = np.float32(np.int32((texel >> np.uint32(16)) & np.uint32(255)))
            q11 = np.float32(np.int32(texel >> np.uint32(24)))
            top = q00 + fx * (q01 - q00)
            bottom = q10 + fx * (q11 - q10)
            grey = top + fy * (bottom - top)
            total += patch[0, k] * grey
            squares += patch[0, k] * grey * grey
            covariance += patch[1, k] * grey
        step = np.float32(1.0 / 255.0)
        mean = total * step
        source_variance = max(squares * step * step - mean * mean, ZERO)
        product = (variance + _VARIANCE_NOISE) * (source_variance + _VARIANCE_NOISE)
        cost = np.float32(1.0) - covariance * step / np.sqrt(product)
    return cost


@inner_kernel()
def reprojection_error(layout, to_source, to_reference, source_planes, s, u, v, w):
    """Pixels between (u, v) at inverse depth ``w`` and where it comes back to through
    the plane source ``s`` has at its projection; the greatest when that leaves it."""
    error = _MAX_REPROJECTION_PX
    m = to_source
    z = m[s, 2, 0] * u + m[s, 2, 1] * v + m[s, 2, 2] + m[s, 2, 3] * w
    px = (m[s, 0, 0] * u + m[s, 0, 1] * v + m[s, 0, 2] + m[s, 0, 3] * w) / z
    py = (m[s, 1, 0] * u + m[s, 1, 1] * v + m[s, 1, 2] + m[s, 1, 3] * w) / z
    first, width, height = layout[s, 0], layout[s, 1], layout[s, 2]
    if z > NEAREST and min(px, py) >= ZERO and px < width and py < height:
        k = first + np.int32(py) * width + np.int32(px)
        w = source_planes[k, 0] * px + source_planes[k, 1] * py + source_planes[k, 2]
        m = to_reference
        z = m[s, 2, 0] * px + m[s, 2, 1] * py + m[s, 2, 2] + m[s, 2, 3] * w
        if z > NEAREST:
            du = (m[s, 0, 0] * px + m[s, 0, 1] * py + m[s, 0, 2] + m[s, 0, 3] * w) / z - u
            dv = (m[s, 1, 0] * px + m[s, 1, 1] * py + m[s, 1, 2] + m[s, 1, 3] * w) / z - v
            error = min(np.sqrt(du * du + dv * dv), _MAX_REPROJECTION_PX)
    return error
