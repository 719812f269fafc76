"""The kernels of slanted-plane PatchMatch stereo.

Every pixel of a reference capture carries a plane as ``(a, b, c)``: the inverse depth it
gives pixel coordinates ``(u, v)`` is ``a * u + b * v + c`` (1/m), so that a plane is
propagated by copying it and induces on a source capture the homography
``infinite + epipole (a, b, c)^T``. The scheme is that of ACMH/ACMM (Xu and Tao, CVPR
2019): red-black sweeps, adaptive sampling of the best neighbour in eight regions, a
choice of sources per pixel, bilaterally weighted NCC, and a geometric-consistency term.

A half sweep writes pixels of one colour and reads its neighbours only from the other;
random numbers are hashes of (pixel, sweep, draw, seed). So the result does not depend on
the number of threads.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from .. import compiled
from ..compiled import prange

# Divisions without Python's check for zero, which would keep the sums out of vectors.
kernel = functools.partial(compiled.kernel, error_model="numpy")
parallel_kernel = functools.partial(compiled.parallel_kernel, error_model="numpy")

WORST_COST = np.float32(2.0)
"""The cost of a hypothesis that cannot be matched; 1 - NCC is never above it."""

# Added to the variance of a patch, (grey level 0..1)^2: a noise of half an 8-bit step.
_VARIANCE_NOISE = np.float32(4e-6)
# The least cosine between a plane's normal and the viewing ray: 81 degrees.
_MIN_COSINE = np.float32(0.16)
# How sharply a source's weight falls with its cost (ACMH's beta).
_WEIGHT_SPREAD = np.float32(0.3)
# A second source counts only with at least this share of the best one's weight.
_MIN_WEIGHT_SHARE = np.float32(0.2)
# Pixels beyond which a reprojection error says no more, and its weight (ACMM: 3, 0.2).
_MAX_REPROJECTION_PX = np.float32(3.0)

# The shares of the normal and of the inverse depth that refinement perturbs at first.
_NORMAL_STEP = np.float32(0.6)
_DEPTH_STEP = np.float32(0.15)
_REFINEMENTS = 5


class Window(NamedTuple):
    """The samples of a matching window and how they are weighted.

    ``du, dv`` (n,) int64 offsets in pixels, a multiple of 16 of them so that the sums
    run in whole vectors; ``spatial`` (n,) float32 the weight of each by distance, 0 for
    the samples that only pad; ``tonal`` (256,) float32 the weight by grey difference in
    8-bit steps; ``radius`` float32 the half width in pixels.
    """

    du: np.ndarray
    dv: np.ndarray
    spatial: np.ndarray
    tonal: np.ndarray
    radius: float


class Reference(NamedTuple):
    """The capture whose planes are estimated.

    ``grey`` (H, W) float32 in [0, 1]; ``lens`` (4,) float32 fx, fy, cx, cy;
    ``inverse_depths`` (2,) float32 least and greatest, 1/m.
    """

    grey: np.ndarray
    lens: np.ndarray
    inverse_depths: np.ndarray


class Sources(NamedTuple):
    """The S captures a reference is matched against, flattened one after the other.

    ``texels`` (T,) uint32, see ``pack_texels``; ``layout`` (S, 3) int64 start, width and
    height of each; ``infinite`` (S, 3, 3) and ``epipole`` (S, 3) float32: reference pixel
    (u, v, 1) at inverse depth w lies at ``infinite @ (u, v, 1) + epipole * w`` in
    homogeneous source pixels, whose third component is the ratio of the depths;
    ``back_infinite``, ``back_epipole`` the same from source to reference; ``planes``
    (T, 3) float32 the sources' own planes for the geometric term, which enters with
    ``geometric_weight`` (0: photometric only) per pixel of reprojection error.
    """

    texels: np.ndarray
    layout: np.ndarray
    infinite: np.ndarray
    epipole: np.ndarray
    back_infinite: np.ndarray
    back_epipole: np.ndarray
    planes: np.ndarray
    geometric_weight: float


class Field(NamedTuple):
    """The state of a reference: updated in place by the sweeps.

    ``planes`` (H, W, 3) float32; ``cost`` (H, W) float32 weighted over the chosen
    sources; ``source_costs`` (H, W, S) float32.
    """

    planes: np.ndarray
    cost: np.ndarray
    source_costs: np.ndarray


def window(radius_px: int, stride_px: int = 2) -> Window:
    """The square window of the given half width, sampled every ``stride_px`` pixels."""
    steps = np.arange(-radius_px, radius_px + 1, stride_px)
    dv, du = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    spatial = np.exp(-(du**2 + dv**2) / (2.0 * radius_px**2)).astype(np.float32)
    padding = -len(du) % 16
    tonal = np.exp(-np.arange(256) / 255.0 / 0.1).astype(np.float32)
    return Window(
        np.pad(du, (0, padding)), np.pad(dv, (0, padding)), np.pad(spatial, (0, padding)),
        tonal, np.float32(radius_px),
    )  # fmt: skip


def sampling_regions() -> np.ndarray:
    """(8, 11, 2) int64 offsets (du, dv), all of the other colour: ACMH's four V-shaped
    near regions and four strips that reach far; repeated entries fill the shorter ones."""
    near = [(0, -1), (-1, -2), (1, -2), (-2, -3), (2, -3), (-3, -4), (3, -4)]
    near += near[:4]
    far = [(0, -n) for n in range(3, 24, 2)]
    turns = ((1, 0, 0, 1), (-1, 0, 0, -1), (0, 1, -1, 0), (0, -1, 1, 0))
    regions = [
        [(a * u + b * v, c * u + d * v) for u, v in arm] for arm in (near, far) for a, b, c, d in turns
    ]
    return np.array(regions, np.int64)


def pack_texels(grey: np.ndarray) -> np.ndarray:
    """(H, W) float grey in [0, 1] as (H * W,) uint32: in each entry the pixel and its
    neighbours to the right, below and below right, 8 bits each from the lowest. So a
    bilinear sample is one load; the last row and column hold no whole cell."""
    eight_bit = (np.clip(grey, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint32)
    texels = np.zeros(grey.shape, np.uint32)
    texels[:-1, :-1] = (
        eight_bit[:-1, :-1] | eight_bit[:-1, 1:] << 8
        | eight_bit[1:, :-1] << 16 | eight_bit[1:, 1:] << 24
    )  # fmt: skip
    return texels.ravel()


@kernel()
def _uniform(pixel, sweep, draw, seed):
    """A hash of its arguments, uniform in [0, 1)."""
    h = np.uint32(pixel) * np.uint32(0x9E3779B1) ^ np.uint32(seed) * np.uint32(0x85EBCA77)
    h = np.uint32(h ^ (np.uint32(sweep) * np.uint32(0xC2B2AE3D) + np.uint32(draw) * np.uint32(0x27D4EB2F)))
    h = np.uint32((h ^ (h >> np.uint32(16))) * np.uint32(0x7FEB352D))
    h = np.uint32((h ^ (h >> np.uint32(15))) * np.uint32(0x846CA68B))
    h = np.uint32(h ^ (h >> np.uint32(16)))
    return np.float32(h >> np.uint32(8)) * np.float32(1.0 / 16777216.0)


@kernel()
def patch_weights(reference, window, x, y, weights, products):
    """Fill ``weights`` (n,), which sum to 1, and ``products`` (n,), the weights times the
    grey less its weighted mean; give the weighted variance of the reference's patch."""
    height, width = reference.grey.shape
    centre = reference.grey[y, x]
    total = np.float32(0.0)
    mean = np.float32(0.0)
    for k in range(weights.shape[0]):
        u, v = x + window.du[k], y + window.dv[k]
        inside = (u >= 0) & (v >= 0) & (u < width) & (v < height)
        grey = reference.grey[v, u] if inside else centre
        tone = np.int64(abs(grey - centre) * np.float32(255.0))
        weight = window.spatial[k] * window.tonal[min(tone, 255)] if inside else np.float32(0.0)
        weights[k] = weight
        products[k] = grey
        total += weight
        mean += weight * grey
    mean /= total
    variance = np.float32(0.0)
    for k in range(weights.shape[0]):
        weight = weights[k] / total
        difference = products[k] - mean
        weights[k] = weight
        products[k] = weight * difference
        variance += weight * difference * difference
    return variance


@kernel()
def photometric_cost(window, sources, s, x, y, a, b, c, weights, products, variance):
    """1 - NCC in [0, 2] between the patch at pixel (x, y) and source ``s`` through the
    homography of the plane ``(a, b, c)``; WORST_COST when the patch leaves the source."""
    first, source_width, source_height = sources.layout[s]
    e0, e1, e2 = sources.epipole[s, 0], sources.epipole[s, 1], sources.epipole[s, 2]
    m = sources.infinite
    h00, h01, h02 = m[s, 0, 0] + e0 * a, m[s, 0, 1] + e0 * b, m[s, 0, 2] + e0 * c
    h10, h11, h12 = m[s, 1, 0] + e1 * a, m[s, 1, 1] + e1 * b, m[s, 1, 2] + e1 * c
    h20, h21, h22 = m[s, 2, 0] + e2 * a, m[s, 2, 1] + e2 * b, m[s, 2, 2] + e2 * c
    half = np.float32(0.5)
    u, v = np.float32(x) + half, np.float32(y) + half
    z0 = h20 * u + h21 * v + h22
    # Texel coordinates: a texel's first value lies at its pixel's centre.
    x0 = h00 * u + h01 * v + h02 - half * z0
    y0 = h10 * u + h11 * v + h12 - half * z0
    xu, xv = h00 - half * h20, h01 - half * h21
    yu, yv = h10 - half * h20, h11 - half * h21

    # A homography keeps the window convex, so its corners say whether all of it is inside.
    r = window.radius
    right = np.float32(source_width) - np.float32(1.001)
    below = np.float32(source_height) - np.float32(1.001)
    for corner in range(4):
        du = r if corner & 1 else -r
        dv = r if corner & 2 else -r
        z = z0 + h20 * du + h21 * dv
        px = x0 + xu * du + xv * dv
        py = y0 + yu * du + yv * dv
        if z < np.float32(1e-3) or px < 0.0 or py < 0.0 or px > right * z or py > below * z:
            return WORST_COST

    total = np.float32(0.0)
    squares = np.float32(0.0)
    covariance = np.float32(0.0)
    texels = sources.texels
    for k in range(weights.shape[0]):
        du, dv = np.float32(window.du[k]), np.float32(window.dv[k])
        scale = np.float32(1.0) / (z0 + h20 * du + h21 * dv)
        px = (x0 + xu * du + xv * dv) * scale
        py = (y0 + yu * du + yv * dv) * scale
        ix, iy = np.int32(px), np.int32(py)
        fx, fy = px - np.float32(ix), py - np.float32(iy)
        texel = texels[np.uint64(first + iy * source_width + ix)]
        q00 = np.float32(np.int32(texel & np.uint32(255)))
        q01 = np.float32(np.int32((texel >> np.uint32(8)) & np.uint32(255)))
        q10 = np.float32(np.int32((texel >> np.uint32(16)) & np.uint32(255)))
        q11 = np.float32(np.int32(texel >> np.uint32(24)))
        top = q00 + fx * (q01 - q00)
        bottom = q10 + fx * (q11 - q10)
        grey = top + fy * (bottom - top)
        total += weights[k] * grey
        squares += weights[k] * grey * grey
        covariance += products[k] * grey
    step = np.float32(1.0 / 255.0)
    mean = total * step
    source_variance = max(squares * step * step - mean * mean, np.float32(0.0))
    product = (variance + _VARIANCE_NOISE) * (source_variance + _VARIANCE_NOISE)
    return np.float32(1.0) - covariance * step / np.sqrt(product)


@kernel()
def reprojection_error(sources, s, u, v, w):
    """Pixels between (u, v) at inverse depth ``w`` and where it comes back to through
    the plane source ``s`` has at its projection; the greatest when that leaves it."""
    first, width, height = sources.layout[s]
    m, e = sources.infinite, sources.epipole
    z = m[s, 2, 0] * u + m[s, 2, 1] * v + m[s, 2, 2] + e[s, 2] * w
    if z < np.float32(1e-3):
        return _MAX_REPROJECTION_PX
    px = (m[s, 0, 0] * u + m[s, 0, 1] * v + m[s, 0, 2] + e[s, 0] * w) / z
    py = (m[s, 1, 0] * u + m[s, 1, 1] * v + m[s, 1, 2] + e[s, 1] * w) / z
    if not (px >= 0.0 and py >= 0.0 and px < width and py < height):
        return _MAX_REPROJECTION_PX
    plane = sources.planes[first + np.int64(py) * width + np.int64(px)]
    back_w = plane[0] * px + plane[1] * py + plane[2]
    m, e = sources.back_infinite, sources.back_epipole
    z = m[s, 2, 0] * px + m[s, 2, 1] * py + m[s, 2, 2] + e[s, 2] * back_w
    if z < np.float32(1e-3):
        return _MAX_REPROJECTION_PX
    du = (m[s, 0, 0] * px + m[s, 0, 1] * py + m[s, 0, 2] + e[s, 0] * back_w) / z - u
    dv = (m[s, 1, 0] * px + m[s, 1, 1] * py + m[s, 1, 2] + e[s, 1] * back_w) / z - v
    return min(np.sqrt(du * du + dv * dv), _MAX_REPROJECTION_PX)


@kernel()
def _source_cost(window, sources, s, x, y, a, b, c, weights, products, variance):
    cost = photometric_cost(window, sources, s, x, y, a, b, c, weights, products, variance)
    if sources.geometric_weight > 0.0:
        u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
        error = reprojection_error(sources, s, u, v, a * u + b * v + c)
        cost += np.float32(sources.geometric_weight) * error
    return cost


@kernel()
def _plane_at(lens, u, v, w, nx, ny, nz):
    """The plane through inverse depth ``w`` at (u, v) with a normal in the camera's frame."""
    rx, ry = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    scale = w / (nx * rx + ny * ry + nz)
    a, b = nx * scale / lens[0], ny * scale / lens[1]
    return a, b, w - a * u - b * v


@kernel()
def _normal_of(lens, a, b, c):
    """The unit normal of a plane in the camera's frame, away from the camera."""
    nx, ny = a * lens[0], b * lens[1]
    nz = a * lens[2] + b * lens[3] + c
    scale = np.float32(1.0) / np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * scale, ny * scale, nz * scale


@kernel()
def _admissible(reference, u, v, a, b, c):
    """Whether a plane lies in the depth range at (u, v) and is not seen edge-on."""
    w = a * u + b * v + c
    if not (w >= reference.inverse_depths[0] and w <= reference.inverse_depths[1]):
        return False
    nx, ny, nz = _normal_of(reference.lens, a, b, c)
    rx, ry = (u - reference.lens[2]) / reference.lens[0], (v - reference.lens[3]) / reference.lens[1]
    cosine = (nx * rx + ny * ry + nz) / np.sqrt(rx * rx + ry * ry + np.float32(1.0))
    return cosine >= _MIN_COSINE


@kernel()
def _random_plane(reference, u, v, pixel, sweep, draw, seed):
    """Inverse depth uniform in the range, normal uniform on a cap around the ray."""
    low, high = reference.inverse_depths
    w = low + (high - low) * _uniform(pixel, sweep, draw, seed)
    cosine = np.float32(0.3) + np.float32(0.7) * _uniform(pixel, sweep, draw + 1, seed)
    angle = np.float32(2.0 * np.pi) * _uniform(pixel, sweep, draw + 2, seed)
    rx, ry = (u - reference.lens[2]) / reference.lens[0], (v - reference.lens[3]) / reference.lens[1]
    length = np.sqrt(rx * rx + ry * ry + np.float32(1.0))
    rx, ry, rz = rx / length, ry / length, np.float32(1.0) / length
    # Two unit vectors across the ray; rz is never 0 for a pinhole.
    sx, sz = rz / np.sqrt(rz * rz + rx * rx), -rx / np.sqrt(rz * rz + rx * rx)
    tx, ty, tz = ry * sz, rz * sx - rx * sz, -ry * sx
    across = np.sqrt(np.float32(1.0) - cosine * cosine)
    p, q = across * np.cos(angle), across * np.sin(angle)
    nx, ny, nz = cosine * rx + p * sx + q * tx, cosine * ry + q * ty, cosine * rz + p * sz + q * tz
    return _plane_at(reference.lens, u, v, w, nx, ny, nz)


@kernel()
def _choose_sources(source_costs, x, y, chosen, shares):
    """The two sources that match best around a pixel and their shares of its cost."""
    height, width, count = source_costs.shape
    best, second = np.float32(-1.0), np.float32(-1.0)
    chosen[0] = chosen[1] = 0
    sharpness = np.float32(-0.5) / (_WEIGHT_SPREAD * _WEIGHT_SPREAD)
    for s in range(count):
        own = source_costs[y, x, s]
        weight = np.float32(2.0) * np.exp(own * own * sharpness)
        for k in range(4):
            u = x + (1 if k == 0 else -1 if k == 1 else 0)
            v = y + (1 if k == 2 else -1 if k == 3 else 0)
            if u >= 0 and v >= 0 and u < width and v < height:
                near = source_costs[v, u, s]
                weight += np.exp(near * near * sharpness)
        if weight > best:
            second, chosen[1] = best, chosen[0]
            best, chosen[0] = weight, s
        elif weight > second:
            second, chosen[1] = weight, s
    best = max(best, np.float32(1e-6))
    if second < _MIN_WEIGHT_SHARE * best:
        second = np.float32(0.0)
    shares[0] = best / (best + second)
    shares[1] = second / (best + second)


@parallel_kernel()
def initialise(field, reference, sweep, seed):
    """Give every pixel without an admissible plane a random one."""
    planes = field.planes
    height, width = reference.grey.shape
    for y in prange(height):
        for x in range(width):
            u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
            a, b, c = planes[y, x]
            if not _admissible(reference, u, v, a, b, c):
                a, b, c = _random_plane(reference, u, v, y * width + x, sweep, 0, seed)
                planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = a, b, c


@parallel_kernel()
def score(field, reference, sources, window):
    """Set every pixel's source costs, and as its cost the mean of the best two."""
    # Arrays of a tuple are written only through names of their own: Numba drops
    # assignments to a tuple's member inside prange.
    planes, cost_map, source_costs = field
    height, width, count = source_costs.shape
    for y in prange(height):
        weights = np.empty(window.du.shape[0], np.float32)
        products = np.empty(window.du.shape[0], np.float32)
        for x in range(width):
            variance = patch_weights(reference, window, x, y, weights, products)
            a, b, c = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
            best = second = WORST_COST
            for s in range(count):
                cost = _source_cost(window, sources, s, x, y, a, b, c, weights, products, variance)
                source_costs[y, x, s] = cost
                if cost < best:
                    best, second = cost, best
                elif cost < second:
                    second = cost
            cost_map[y, x] = np.float32(0.5) * (best + min(second, np.float32(1.0)))


@parallel_kernel()
def half_sweep(field, reference, sources, window, regions, colour, sweep, fineness, seed):
    """Propagate to, and refine, the pixels with ``(x + y) % 2 == colour``.

    ``fineness`` float32 scales the perturbations of the refinement, 1 at first.
    """
    # Arrays of a tuple are written only through names of their own: Numba drops
    # assignments to a tuple's member inside prange.
    planes, cost_map, source_costs = field
    height, width, count = source_costs.shape
    for y in prange(height):
        weights = np.empty(window.du.shape[0], np.float32)
        products = np.empty(window.du.shape[0], np.float32)
        chosen = np.zeros(2, np.int64)
        shares = np.zeros(2, np.float32)
        for x in range((y + colour) % 2, width, 2):
            u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
            pixel = y * width + x
            variance = patch_weights(reference, window, x, y, weights, products)
            _choose_sources(source_costs, x, y, chosen, shares)
            a, b, c = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
            best = shares[0] * source_costs[y, x, chosen[0]]
            best += shares[1] * source_costs[y, x, chosen[1]]
            changed = False
            for k in range(8 + _REFINEMENTS):
                if k < 8:
                    lowest = np.float32(1.2)
                    pu, pv = -1, -1
                    for j in range(regions.shape[1]):
                        ru, rv = x + regions[k, j, 0], y + regions[k, j, 1]
                        if ru >= 0 and rv >= 0 and ru < width and rv < height and cost_map[rv, ru] < lowest:
                            lowest = cost_map[rv, ru]
                            pu, pv = ru, rv
                    if pu < 0:
                        continue
                    ta, tb, tc = planes[pv, pu, 0], planes[pv, pu, 1], planes[pv, pu, 2]
                    if ta == a and tb == b and tc == c:
                        continue
                else:
                    draw = 8 * k
                    if k == 8:
                        ta, tb, tc = _random_plane(reference, u, v, pixel, sweep, draw, seed)
                    else:
                        scale = fineness * np.float32(0.5) ** ((k - 9) // 2)
                        w = a * u + b * v + c
                        nx, ny, nz = _normal_of(reference.lens, a, b, c)
                        if k != 10:
                            w *= np.float32(1.0) + scale * _DEPTH_STEP * (
                                np.float32(2.0) * _uniform(pixel, sweep, draw, seed) - np.float32(1.0)
                            )
                        if k != 9:
                            step = np.float32(2.0) * _NORMAL_STEP * scale
                            nx += step * (_uniform(pixel, sweep, draw + 1, seed) - np.float32(0.5))
                            ny += step * (_uniform(pixel, sweep, draw + 2, seed) - np.float32(0.5))
                            nz += step * (_uniform(pixel, sweep, draw + 3, seed) - np.float32(0.5))
                        ta, tb, tc = _plane_at(reference.lens, u, v, w, nx, ny, nz)
                if not _admissible(reference, u, v, ta, tb, tc):
                    continue
                cost = np.float32(0.0)
                for i in range(2):
                    if shares[i] > 0.0 and cost < best:
                        cost += shares[i] * _source_cost(
                            window, sources, chosen[i], x, y, ta, tb, tc, weights, products, variance
                        )
                if cost < best:
                    best = cost
                    a, b, c = ta, tb, tc
                    changed = True
            cost_map[y, x] = best
            if changed:
                planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = a, b, c
                for s in range(count):
                    source_costs[y, x, s] = _source_cost(
                        window, sources, s, x, y, a, b, c, weights, products, variance
                    )
