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

from ...core.compiled import KernelDecorator, prange
from ...core.compiled import parallel_kernel as plain_parallel_kernel
from .matching import WORST_COST, ZERO, inner_kernel, photometric_cost, reprojection_error, weigh_patch

parallel_kernel: KernelDecorator = functools.partial(plain_parallel_kernel, error_model="numpy")

# The least cosine between a plane's normal and the viewing ray: 81 degrees.
_MIN_COSINE = np.float32(0.16)
# How sharply a source's weight falls with its cost (ACMH's beta).
_WEIGHT_SPREAD = np.float32(0.3)
# A second source counts only with at least this share of the best one's weight.
_MIN_WEIGHT_SHARE = np.float32(0.2)
# A pixel whose cost is higher does not pass its plane on.
_MAX_PROPAGATED_COST = np.float32(1.2)

# The shares of the normal and of the inverse depth that refinement perturbs at first.
_NORMAL_STEP = np.float32(0.6)
_DEPTH_STEP = np.float32(0.15)
_REFINEMENTS = 5


class Field(NamedTuple):
    """The state of a reference: updated in place by the sweeps.

    ``planes`` (H, W, 3) float32; ``cost`` (H, W) float32 weighted over the chosen
    sources; ``source_costs`` (H, W, S) float32.
    """

    planes: np.ndarray
    cost: np.ndarray
    source_costs: np.ndarray


def sampling_regions() -> np.ndarray:
    """(8, 11, 2) int64 offsets (du, dv), all of the other colour: ACMH's four V-shaped
    near regions and four strips that reach far; repeated entries fill the shorter ones."""
    near = [(0, -1), (-1, -2), (1, -2), (-2, -3), (2, -3), (-3, -4), (3, -4)]
    near += near[:4]
    far = [(0, -n) for n in range(3, 24, 2)]
    turns = ((1, 0, 0, 1), (-1, 0, 0, -1), (0, 1, -1, 0), (0, -1, 1, 0))
    regions = [[(a * u + b * v, c * u + d * v) for u, v in arm] for arm in (near, far) for a, b, c, d in turns]
    return np.array(regions, np.int64)


@inner_kernel()
def _uniform(pixel, sweep, draw, seed):
    """A hash of its arguments, uniform in [0, 1)."""
    h = np.uint32(pixel) * np.uint32(0x9E3779B1) ^ np.uint32(seed) * np.uint32(0x85EBCA77)
    h = np.uint32(h ^ (np.uint32(sweep) * np.uint32(0xC2B2AE3D) + np.uint32(draw) * np.uint32(0x27D4EB2F)))
    h = np.uint32((h ^ (h >> np.uint32(16))) * np.uint32(0x7FEB352D))
    h = np.uint32((h ^ (h >> np.uint32(15))) * np.uint32(0x846CA68B))
    h = np.uint32(h ^ (h >> np.uint32(16)))
    return np.float32(h >> np.uint32(8)) * np.float32(1.0 / 16777216.0)


@inner_kernel()
def _plane_at(lens, u, v, w, nx, ny, nz):
    """The plane through inverse depth ``w`` at (u, v) with a normal in the camera's frame."""
    rx, ry = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    scale = w / (nx * rx + ny * ry + nz)
    a, b = nx * scale / lens[0], ny * scale / lens[1]
    return a, b, w - a * u - b * v


@inner_kernel()
def _normal_of(lens, a, b, c):
    """The unit normal of a plane in the camera's frame, away from the camera."""
    nx, ny = a * lens[0], b * lens[1]
    nz = a * lens[2] + b * lens[3] + c
    scale = np.float32(1.0) / np.sqrt(nx * nx + ny * ny + nz * nz)
    return nx * scale, ny * scale, nz * scale


@inner_kernel()
def _admissible(lens, u, v, a, b, c):
    """Whether a plane lies in the depth range at (u, v) and is not seen edge-on."""
    w = a * u + b * v + c
    if not (w >= lens[4] and w <= lens[5]):
        return False
    nx, ny, nz = _normal_of(lens, a, b, c)
    rx, ry = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    cosine = (nx * rx + ny * ry + nz) / np.sqrt(rx * rx + ry * ry + np.float32(1.0))
    return cosine >= _MIN_COSINE


@inner_kernel()
def _random_plane(lens, u, v, pixel, sweep, draw, seed):
    """Inverse depth uniform in the range, normal uniform on a cap around the ray."""
    low, high = lens[4], lens[5]
    w = low + (high - low) * _uniform(pixel, sweep, draw, seed)
    cosine = np.float32(0.3) + np.float32(0.7) * _uniform(pixel, sweep, draw + 1, seed)
    angle = np.float32(2.0 * np.pi) * _uniform(pixel, sweep, draw + 2, seed)
    rx, ry = (u - lens[2]) / lens[0], (v - lens[3]) / lens[1]
    length = np.sqrt(rx * rx + ry * ry + np.float32(1.0))
    rx, ry, rz = rx / length, ry / length, np.float32(1.0) / length
    # Two unit vectors across the ray; rz is never 0 for a pinhole.
    sx, sz = rz / np.sqrt(rz * rz + rx * rx), -rx / np.sqrt(rz * rz + rx * rx)
    tx, ty, tz = ry * sz, rz * sx - rx * sz, -ry * sx
    across = np.sqrt(np.float32(1.0) - cosine * cosine)
    p, q = across * np.cos(angle), across * np.sin(angle)
    nx, ny, nz = cosine * rx + p * sx + q * tx, cosine * ry + q * ty, cosine * rz + p * sz + q * tz
    return _plane_at(lens, u, v, w, nx, ny, nz)


@inner_kernel()
def _affinity(cost):
    """About exp(-cost^2 / 2 spread^2), without the exponential."""
    root = np.float32(1.0) + cost * cost * (np.float32(0.125) / (_WEIGHT_SPREAD * _WEIGHT_SPREAD))
    square = root * root
    return np.float32(1.0) / (square * square)


@inner_kernel()
def _choose_sources(source_costs, x, y, chosen, shares):
    """The two sources that match best around a pixel and their shares of its cost."""
    height, width, count = source_costs.shape
    best, second = np.float32(-1.0), np.float32(-1.0)
    chosen[0] = chosen[1] = 0
    for s in range(count):
        own = source_costs[y, x, s]
        weight = np.float32(2.0) * _affinity(own)
        for k in range(4):
            u = x + (1 if k == 0 else -1 if k == 1 else 0)
            v = y + (1 if k == 2 else -1 if k == 3 else 0)
            if u >= 0 and v >= 0 and u < width and v < height:
                weight += _affinity(source_costs[v, u, s])
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


@inner_kernel()
def _best_neighbour(cost_map, regions, region, x, y):
    """The pixel of a sampling region with the least cost, (-1, -1) when none is good."""
    height, width = cost_map.shape
    lowest = _MAX_PROPAGATED_COST
    column = row = -1
    for k in range(regions.shape[1]):
        u, v = x + regions[region, k, 0], y + regions[region, k, 1]
        if u >= 0 and v >= 0 and u < width and v < height and cost_map[v, u] < lowest:
            lowest = cost_map[v, u]
            column, row = u, v
    return column, row


@inner_kernel()
def _perturbed(lens, u, v, a, b, c, kind, fineness, pixel, sweep, draw, seed):
    """A plane near the given one: kind 0 changes the depth, 1 the normal, 2 and 3 both."""
    scale = fineness if kind < 2 else np.float32(0.5) * fineness
    w = a * u + b * v + c
    nx, ny, nz = _normal_of(lens, a, b, c)
    half = np.float32(0.5)
    if kind != 1:
        step = np.float32(2.0) * _DEPTH_STEP * scale
        w *= np.float32(1.0) + step * (_uniform(pixel, sweep, draw, seed) - half)
    if kind != 0:
        step = np.float32(2.0) * _NORMAL_STEP * scale
        nx += step * (_uniform(pixel, sweep, draw + 1, seed) - half)
        ny += step * (_uniform(pixel, sweep, draw + 2, seed) - half)
        nz += step * (_uniform(pixel, sweep, draw + 3, seed) - half)
    return _plane_at(lens, u, v, w, nx, ny, nz)


@parallel_kernel()
def initialise(planes, reference, sweep, seed):
    """Give every pixel of ``planes`` (H, W, 3) without an admissible plane a random one."""
    lens = reference.lens
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
            a, b, c = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
            if not _admissible(lens, u, v, a, b, c):
                a, b, c = _random_plane(lens, u, v, y * width + x, sweep, 0, seed)
                planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = a, b, c


@parallel_kernel()
def score(field, reference, sources, window):
    """Set every pixel's source costs, and as its cost the mean of the best two."""
    # Arrays of a tuple are written only through names of their own: Numba drops
    # assignments to a tuple's member inside prange.
    planes, cost_map, source_costs = field
    grey, opponent, _ = reference
    texels, layout, to_source, to_reference, source_planes, geometric_weight = sources
    offsets, spatial, tonal = window
    height, width, count = source_costs.shape
    for y in prange(height):
        patch = np.empty((2, offsets.shape[1]), np.float32)
        for x in range(width):
            u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
            variance = weigh_patch(grey, opponent, offsets, spatial, tonal, x, y, patch)
            a, b, c = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
            best = second = WORST_COST
            for s in range(count):
                cost = photometric_cost(texels, layout, to_source, offsets, s, x, y, a, b, c, patch, variance)
                if geometric_weight > ZERO:
                    cost += geometric_weight * reprojection_error(
                        layout, to_source, to_reference, source_planes, s, u, v, a * u + b * v + c
                    )
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
    planes, cost_map, source_costs = field  # names of their own, as in ``score``
    grey, opponent, lens = reference
    texels, layout, to_source, to_reference, source_planes, geometric_weight = sources
    offsets, spatial, tonal = window
    height, width, count = source_costs.shape
    for y in prange(height):
        patch = np.empty((2, offsets.shape[1]), np.float32)
        chosen = np.zeros(2, np.int64)
        shares = np.zeros(2, np.float32)
        for x in range((y + colour) % 2, width, 2):
            u, v = np.float32(x) + np.float32(0.5), np.float32(y) + np.float32(0.5)
            pixel = y * width + x
            variance = weigh_patch(grey, opponent, offsets, spatial, tonal, x, y, patch)
            _choose_sources(source_costs, x, y, chosen, shares)
            a, b, c = planes[y, x, 0], planes[y, x, 1], planes[y, x, 2]
            best = shares[0] * source_costs[y, x, chosen[0]] + shares[1] * source_costs[y, x, chosen[1]]
            changed = False
            # Eight propagated hypotheses, then the refinements, then once more the best
            # one against all the sources, to keep their costs up to date.
            for k in range(8 + _REFINEMENTS + 1):
                last = k == 8 + _REFINEMENTS
                ta, tb, tc = a, b, c
                if k < 8:
                    pu, pv = _best_neighbour(cost_map, regions, k, x, y)
                    if pu < 0:
                        continue
                    ta, tb, tc = planes[pv, pu, 0], planes[pv, pu, 1], planes[pv, pu, 2]
                    if ta == a and tb == b and tc == c:
                        continue
                elif k == 8:
                    ta, tb, tc = _random_plane(lens, u, v, pixel, sweep, 8 * k, seed)
                elif not last:
                    ta, tb, tc = _perturbed(lens, u, v, a, b, c, k - 9, fineness, pixel, sweep, 8 * k, seed)
                if (last and not changed) or (not last and not _admissible(lens, u, v, ta, tb, tc)):
                    continue
                cost = ZERO
                for i in range(count if last else 2):
                    s = i if last else chosen[i]
                    if not last and (shares[i] == ZERO or cost >= best):
                        continue  # a share of nothing, or the hypothesis has lost already
                    matching = photometric_cost(
                        texels, layout, to_source, offsets, s, x, y, ta, tb, tc, patch, variance
                    )
                    if geometric_weight > ZERO:
                        matching += geometric_weight * reprojection_error(
                            layout, to_source, to_reference, source_planes, s, u, v, ta * u + tb * v + tc
                        )
                    if last:
                        source_costs[y, x, s] = matching
                    else:
                        cost += shares[i] * matching
                if not last and cost < best:
                    best = cost
                    a, b, c = ta, tb, tc
                    changed = True
            cost_map[y, x] = best
            planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = a, b, c
