"""The geometry availability g of many views: the share of pixels that the proxy can render.

A sample of a pixel is valid where it shows the free side of a face that some capture saw, not
too flatly and not from too far away for this view; a pixel's validity is the share of its
samples. The z-buffer keeps one integer a sample, the
inverse depth's bits with the lowest telling whether the face is valid. The faces stand in
clusters of neighbours, so that a view skips the clusters it does not see at once, and a
thread works on a whole view at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba.core.types import float32, int64, void

from ...core.cameras import Camera
from ...core.compiled import inlined, kernel, parallel_kernel, prange
from ...geometry.mesh.meshes import require_sound
from ...geometry.proxy.proxy import GeometryProxy, Provenance
from ...geometry.visibility.coverage import face_areas
from ...geometry.visibility.face_sight import STEEP, FaceSight
from ...geometry.visibility.projection import NEAR_M, place, screen_extent
from ...geometry.visibility.rasterizer import edge_plane
from ...geometry.visibility.view_volume import in_view, side_planes
from ...splats.kernels.packing import morton_order
from ...splats.vector_language.aligned_memory import aligned
from ...splats.vector_language.vectors import LANES, VECTOR_BYTES, Code, Value, vector_kernel

SAMPLES = 2
"""Samples of a pixel, a side."""

_LARGEST_STRETCH = 4.0
"""Pixels of a view, a side, that one of a photograph may fill: beyond, there is only a smear to show."""

_CLUSTER = 128  # faces: few enough for their vertices to stay in a core's own memory
_ROUNDING_PX = 1e-6  # bounds are widened by this, so that rounding never loses a sample
_GREATEST = 1e30  # inverse depth at the camera plane


class ValidityRenderer:
    """Scores views of one proxy. Raises GeometryError for a mesh that cannot be drawn.

    ``sight`` tells how well the captures saw its faces: what they saw as flatly as floor far off,
    or more coarsely than a view shows it, is not available there, and of what was estimated the less
    the less certain it is. Without it support alone counts.
    """

    def __init__(self, proxy: GeometryProxy, sight: FaceSight | None = None) -> None:
        vertices, faces = np.asarray(proxy.vertices, np.float64), np.asarray(proxy.faces, np.int64)
        require_sound(vertices, faces, "Run the round again.", "proxy")
        order = morton_order(vertices[faces].mean(axis=1)) if len(faces) else np.zeros(0, np.int64)
        faces = faces[order]
        self._largest_px2 = np.ascontiguousarray(_largest_px2(proxy, sight)[order])
        # Each cluster has its own vertices, in the mesh's order: two faces of an edge that two
        # clusters share meet in the same numbers.
        cluster = np.arange(len(faces), dtype=np.int64) // _CLUSTER  # NumPy 1 counts in 32 bits on Windows
        keys, local = np.unique(cluster[:, None] * len(vertices) + faces, return_inverse=True)
        clusters = np.arange(-(-len(faces) // _CLUSTER) + 1, dtype=np.int64)
        self._starts = np.searchsorted(keys, clusters * len(vertices))
        self._vertices = vertices[keys % max(len(vertices), 1)]
        self._faces = (local.reshape(-1, 3) - self._starts[cluster, None]).astype(np.int16)
        self._spheres = _spheres(self._vertices, self._starts)
        self._planes = aligned((0, 0, 0), np.int32)

    def available_shares(
        self, cameras: Sequence[Camera], validity_threshold: float, sample_spread: float = 1.0
    ) -> np.ndarray:
        """(M,) float64: the share of each view's pixels whose validity reaches the threshold.

        The samples fill the middle ``sample_spread`` of a pixel, of its sides.
        """
        if not cameras:
            return np.zeros(0)
        if len({(c.shape, c.fx, c.fy, c.cx, c.cy) for c in cameras}) > 1:
            raise ValueError("the views must have one lens")
        lens = cameras[0]
        offsets = 0.5 + sample_spread * ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5)
        x, y = (
            (np.arange(size)[:, None] + offsets).ravel() - centre
            for size, centre in ((lens.width, lens.cx), (lens.height, lens.cy))
        )
        x = np.append(x / lens.fx, np.zeros(LANES)).astype(np.float32)
        y = (y / lens.fy).astype(np.float32)
        planes = self._planes_for(len(cameras), lens)
        _render(
            np.stack([camera.camera_from_world[:3] for camera in cameras]),
            np.array([lens.fx, lens.fy, lens.cx, lens.cy]),
            lens.width,
            lens.height,
            offsets,
            self._vertices,
            self._starts,
            self._spheres,
            self._faces,
            self._largest_px2 * sample_spread**2,
            x.ctypes.data,
            y.ctypes.data,
            planes.ctypes.data,
            planes.strides[0],
        )
        enough = int(np.ceil(validity_threshold * SAMPLES**2 - 1e-9))
        return _count_available(planes, lens.width, lens.height, SAMPLES, enough) / (lens.width * lens.height)

    def _planes_for(self, views: int, lens: Camera) -> np.ndarray:
        """(M, samples down, samples across and to spare) int32; kept from call to call."""
        shape = (views, lens.height * SAMPLES + 1, _pitch_bytes(lens.width * SAMPLES) // 4)
        if self._planes.shape != shape:
            self._planes = aligned(shape, np.int32)
        return self._planes


def _largest_px2(proxy: GeometryProxy, sight: FaceSight | None) -> np.ndarray:
    """(F,) float64: the area in pixels up to which each face is valid in a view; 0 where it never is."""
    if sight is None:
        return np.where(proxy.support > 0, np.inf, 0.0)
    photographed_px2 = sight.density * face_areas(proxy.vertices, proxy.faces)
    # An estimate is the farther off the more a view differs from the photograph: less of a stretch hides it.
    estimated = proxy.provenance == Provenance.ESTIMATED
    photographed_px2 = np.where(estimated, photographed_px2 * proxy.confidence, photographed_px2)
    steep = (proxy.support > 0) & (sight.cosine >= STEEP)
    return np.where(steep, photographed_px2 * _LARGEST_STRETCH**2, 0.0)


def _spheres(vertices: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(C, 4): centre and radius around each cluster's vertices."""
    if len(starts) < 2:
        return np.zeros((0, 4))
    low, high = (f.reduceat(vertices, starts[:-1]) for f in (np.minimum, np.maximum))
    centres = 0.5 * (low + high)
    sizes = np.diff(starts)
    distances = np.linalg.norm(vertices - np.repeat(centres, sizes, axis=0), axis=1)
    return np.column_stack([centres, np.maximum.reduceat(distances, starts[:-1])])


@inlined
def _pitch_bytes(columns):
    """From row to row: room for a vector that begins at the last column."""
    return (columns + 2 * LANES - 1) // LANES * VECTOR_BYTES


@parallel_kernel
def _render(
    poses, lens, width, height, offsets, vertices, starts, spheres, faces, largest_px2, x, y, planes, plane_bytes
):
    """Fill each view's z-buffer; ``x``, ``y``, the samples' rays, and ``planes`` are addresses."""
    for view in prange(poses.shape[0]):
        plane, pose = planes + view * plane_bytes, poses[view]
        _clear(plane, plane_bytes // VECTOR_BYTES)
        local, screen = np.empty((3 * _CLUSTER, 3)), np.empty((3 * _CLUSTER, 2))
        sides = side_planes(lens, width, height)
        for cluster in range(spheres.shape[0]):
            if not in_view(pose, sides, spheres[cluster]):
                continue
            first, last = starts[cluster], starts[cluster + 1]
            for k in range(last - first):
                place(vertices, first + k, pose, lens, local, screen, k)
            for f in range(cluster * _CLUSTER, min(faces.shape[0], (cluster + 1) * _CLUSTER)):
                _draw(local, screen, faces[f], largest_px2[f], lens, width, height, offsets, x, y, plane)


@inlined
def _first_sample(px, offsets):
    """The first sample at ``px`` or after, of a row of pixels."""
    pixel = np.floor(px)
    part, before = px - pixel, 0
    for offset in offsets:
        before += offset < part
    return np.int64(pixel) * offsets.shape[0] + before


@vector_kernel(void(int64, int64))
def _clear(code: Code, plane: Value, vectors: Value) -> None:
    """Nothing drawn yet."""
    with code.loop(vectors) as k:
        code.store(plane + k * VECTOR_BYTES, code.vector(0.0))


@vector_kernel(void(*[int64] * 7, *[float32] * 14))
def _fill(
    code: Code,
    corner: Value,
    pitch: Value,
    x: Value,
    y: Value,
    columns: Value,
    rows: Value,
    valid: Value,
    ax: Value,
    ay: Value,
    az: Value,
    bx: Value,
    by: Value,
    bz: Value,
    cx: Value,
    cy: Value,
    cz: Value,
    dx: Value,
    dy: Value,
    dz: Value,
    farthest: Value,
    closest: Value,
) -> None:
    """Draw a face into the samples from ``corner``, sixteen columns at a time.

    The edge functions and the inverse depth are z + x right + y down; two faces of an edge
    have exactly opposite edge functions, and so exactly opposite values at a sample.
    """
    lanes = code.vector([float(lane) for lane in range(LANES)])
    tag = code.spread(code.to_int(valid))
    planes = ((ax, ay, az), (bx, by, bz), (cx, cy, cz), (dx, dy, dz))
    downs = [code.spread(down) for _, down, _ in planes]
    done = code.variable(code.long(0))
    with code.loop_while(lambda: done.get() < columns):
        across = code.load(x + done.get() * 4, aligned=False)
        starts = [code.fma(across, right, start) for right, _, start in planes]
        present = lanes < code.to_floats(columns - done.get())
        top = corner + done.get() * 4
        with code.loop(rows) as row:
            slope = code.spread(code.load_float(y + row * 4))
            *edges, inverse = (code.fma(slope, down, start) for down, start in zip(downs, starts, strict=True))
            inside = present
            for edge in edges:
                inside = inside & (edge >= 0.0)
            # A face seen edge-on is ill-conditioned, but never leaves its corners' range.
            inverse = code.minimum(code.maximum(inverse, farthest), closest)
            key = (code.as_integers(inverse) & -2) | tag
            place = top + row * pitch
            before = code.as_integers(code.load(place, aligned=False))
            drawn = inside & (inverse <= 1.0 / NEAR_M) & (key > before)
            code.store(place, code.as_floats(code.select(drawn, key, before)), aligned=False)
        done.add(code.long(LANES))


@kernel
def _draw(local, screen, face, largest_px2, lens, width, height, offsets, x, y, plane):
    """Draw a face into the z-buffer of samples, as ``geometry.visibility.rasterizer`` does."""
    i, j, k = face[0], face[1], face[2]
    zi, zj, zk = local[i, 2], local[j, 2], local[k, 2]
    if zi < NEAR_M and zj < NEAR_M and zk < NEAR_M:
        return
    low_u, high_u, low_v, high_v = screen_extent(local, screen, face, lens)
    low_u, high_u = max(low_u - _ROUNDING_PX, 0.0), min(high_u + _ROUNDING_PX, float(width))
    low_v, high_v = max(low_v - _ROUNDING_PX, 0.0), min(high_v + _ROUNDING_PX, float(height))
    if low_u >= high_u or low_v >= high_v:
        return
    first_column, end_column = _first_sample(low_u, offsets), _first_sample(high_u, offsets)
    first_row, end_row = _first_sample(low_v, offsets), _first_sample(high_v, offsets)
    if first_column >= end_column or first_row >= end_row:
        return
    ax, ay, az = edge_plane(local, j, k)
    bx, by, bz = edge_plane(local, k, i)
    cx, cy, cz = edge_plane(local, i, j)
    det = local[i, 0] * ax + local[i, 1] * ay + local[i, 2] * az
    if det == 0.0:
        return
    sign = 1.0 if det > 0.0 else -1.0
    low, high = min(zi, zj, zk), max(zi, zj, zk)
    # The determinant is twice the area at focal length 1, times the corners' depths.
    fine = low > 0.0 and -det * lens[0] * lens[1] <= 2.0 * zi * zj * zk * largest_px2
    valid = np.int32(1) if det < 0.0 and (fine or largest_px2 == np.inf) else np.int32(0)
    scale = 1.0 / (det * sign)
    ax, ay, az = ax * sign, ay * sign, az * sign
    bx, by, bz = bx * sign, by * sign, bz * sign
    cx, cy, cz = cx * sign, cy * sign, cz * sign
    closest = min(1.0 / low, _GREATEST) if low > 0.0 else _GREATEST
    pitch = _pitch_bytes(width * offsets.shape[0])
    _fill(
        plane + first_row * pitch + 4 * first_column,
        pitch,
        x + 4 * first_column,
        y + 4 * first_row,
        end_column - first_column,
        end_row - first_row,
        valid,
        np.float32(ax),
        np.float32(ay),
        np.float32(az),
        np.float32(bx),
        np.float32(by),
        np.float32(bz),
        np.float32(cx),
        np.float32(cy),
        np.float32(cz),
        np.float32((ax + bx + cx) * scale),
        np.float32((ay + by + cy) * scale),
        np.float32((az + bz + cz) * scale),
        np.float32(1.0 / high),
        np.float32(closest),
    )


@parallel_kernel
def _count_available(planes, width, height, samples, enough):
    """(M,) int64: the pixels of each view of which ``enough`` samples are valid."""
    counts = np.zeros(planes.shape[0], np.int64)
    for view in prange(planes.shape[0]):
        count = 0
        for row in range(0, height * samples, samples):
            for column in range(0, width * samples, samples):
                valid = 0
                for k in range(samples):
                    for m in range(samples):
                        valid += planes[view, row + k, column + m] & 1
                count += valid >= enough
        counts[view] = count
    return counts
