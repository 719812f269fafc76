"""Projection of Gaussians to the screen (EWA splatting, as 3DGS), sixteen at a time.

A projected Gaussian is a *record* of sixteen floats: centre (u, v) in pixels; the factor
(a, b; 0, c) of its quadratic form; an eighth of log2 of its opacity; colour; planar depth
in metres; half extents in pixels of the ellipse outside which alpha is below 1/255; and
what the binning needs of them. At the distance (dx, dy) from the centre

    e = a dx + b dy,   f = c dy,   alpha = 2 ** (8 (eighth - e^2 - f^2)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numba.core.types import int64

from ...core.cameras import Camera
from ..harmonics import basis_values
from ..vector_language.denormals import flush_denormals, restore_denormals
from ..vector_language.exponentials import exp2, log2
from ..vector_language.lanes import transposed
from ..vector_language.vectors import VECTOR_BYTES, Code, Value, vector_kernel
from .compiled import dealt, parallel_kernel, prange, turns
from .packing import HARMONICS, LOG_SCALE, LOGIT_OPACITY, MEAN, QUATERNION
from .tiles import TILE_SHIFT

U, V, FACTOR_A, FACTOR_B, FACTOR_C, EIGHTH, RED, GREEN, BLUE, DEPTH, EXTENT_Y, SKEW_Y = range(12)
INVERSE_A, TILES_X, TILES_Y = range(12, 15)
"""Places in a record; SKEW_Y is dy at the ellipse's rightmost point, INVERSE_A is 1 / a. TILES_X and
TILES_Y are int32: the first column (row) of tiles that the ellipse reaches, and the last above 16 bits."""

RECORD_BYTES = VECTOR_BYTES

NEAREST_M = 0.2
"""Gaussians nearer than this to the camera plane are not drawn, as in 3DGS."""

DILATION_PX2 = 0.3
"""Added to the screen-space variances, as in 3DGS."""

SMALLEST_ALPHA = 1.0 / 255.0
LARGEST_ALPHA = 0.99

EIGHTH_SMALLEST = math.log2(SMALLEST_ALPHA) / 8.0
FORM_SCALE = 0.5 / math.log(2.0) / 8.0
"""e^2 + f^2 is this times the squared Mahalanobis distance."""

BLOCK = 64
"""Chunks that a thread takes at a time."""

_TINY = 1e-20
_LARGEST_LOGIT = 60.0
_LOG_SCALE_BOUNDS = (-80.0, 12.0)
_LARGEST_QUATERNION = 1e15
_LARGEST_VARIANCE_PX2 = 1e14
_LARGEST_COLOUR = 1e4

# The lens array: camera_from_world rotation (row-major) and translation, centre,
# focal lengths, principal point, size, and the bounds of x/z and y/z beyond which the
# linearised projection is held (as in 3DGS: 30 % of the field of view outside the image).
_TRANSLATION, _CENTRE, _FX, _FY, _CX, _CY, WIDTH, HEIGHT, _BOUNDS = 9, 12, 15, 16, 17, 18, 19, 20, 21
_DILATION, _LENS_SIZE = 25, 26


def lens_of(camera: Camera, dilation_px2: float = DILATION_PX2) -> np.ndarray:
    """The camera as the (26,) float32 array the kernels read."""
    margin_x = 0.15 * camera.width / camera.fx
    margin_y = 0.15 * camera.height / camera.fy
    rows = camera.camera_from_world[:3].tolist()
    numbers = [
        *(number for row in rows for number in row[:3]),
        *(row[3] for row in rows),
        *camera.centre.tolist(),
        *(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height),
        *(-camera.cx / camera.fx - margin_x, (camera.width - camera.cx) / camera.fx + margin_x),
        *(-camera.cy / camera.fy - margin_y, (camera.height - camera.cy) / camera.fy + margin_y),
        dilation_px2,
    ]
    return np.array(numbers, np.float32)


@dataclass
class Lens:
    """The lens array's numbers, each spread over the lanes."""

    values: list[Value]

    @staticmethod
    def load(code: Code, address: Value) -> Lens:
        return Lens([code.spread(code.load_float(address + 4 * k)) for k in range(_LENS_SIZE)])

    def rotated(self, x: Value, y: Value, z: Value) -> list[Value]:
        """camera_from_world's rotation times a vector."""
        r = self.values
        return [r[3 * k] * x + r[3 * k + 1] * y + r[3 * k + 2] * z for k in range(3)]

    def rotated_back(self, x: Value, y: Value, z: Value) -> list[Value]:
        """The transposed rotation times a vector."""
        r = self.values
        return [r[k] * x + r[3 + k] * y + r[6 + k] * z for k in range(3)]

    def point(self, mean: list[Value]) -> list[Value]:
        """World to camera."""
        return [a + self.values[_TRANSLATION + k] for k, a in enumerate(self.rotated(*mean))]

    def __getitem__(self, index: int) -> Value:
        return self.values[index]


def parameter(code: Code, chunk: Value, row: int) -> Value:
    """A row of a chunk."""
    return code.load(chunk + VECTOR_BYTES * row)


def sigmoid(code: Code, logit: Value) -> tuple[Value, Value]:
    """The opacity, and its binary logarithm."""
    bounded = code.minimum(code.maximum(logit, -_LARGEST_LOGIT), _LARGEST_LOGIT)
    inverse = exp2(bounded * (-1.0 / math.log(2.0))) + 1.0
    return 1.0 / inverse, -log2(inverse)


def point_on_screen(code: Code, lens: Lens, chunk: Value) -> SimpleNamespace:
    """``mean`` and camera ``point``, its ``inverse_z`` and slopes, and whether it is ``ahead``."""
    mean = [parameter(code, chunk, MEAN + k) for k in range(3)]
    point = lens.point(mean)
    ahead = (point[2] > NEAREST_M) & (point[2] < _LARGEST_VARIANCE_PX2)
    inverse_z = 1.0 / code.maximum(point[2], NEAREST_M)
    return SimpleNamespace(
        mean=mean,
        point=point,
        ahead=ahead,
        inverse_z=inverse_z,
        slope_x=point[0] * inverse_z,
        slope_y=point[1] * inverse_z,
    )


def ellipsoid_on_screen(code: Code, lens: Lens, chunk: Value, at: SimpleNamespace) -> SimpleNamespace:
    """The Gaussian's axes, the linearised projection, and the covariance it has in the image.

    ``row_x`` and ``row_y`` are the images in pixels of the three axes; the variances and the
    covariance are ``xx``, ``yy`` and ``xy`` in square pixels.
    """
    logs = [parameter(code, chunk, LOG_SCALE + k) for k in range(3)]
    low, high = _LOG_SCALE_BOUNDS
    scales = [exp2(code.minimum(code.maximum(s, low), high) * (1.0 / math.log(2.0))) for s in logs]
    free = [(s > low) & (s < high) for s in logs]
    bound = _LARGEST_QUATERNION
    raw = [code.minimum(code.maximum(parameter(code, chunk, QUATERNION + k), -bound), bound) for k in range(4)]
    length2 = raw[0] * raw[0] + raw[1] * raw[1] + raw[2] * raw[2] + raw[3] * raw[3]
    inverse_norm = 1.0 / code.sqrt(length2 + _TINY)
    w, x, y, z = (q * inverse_norm for q in raw)
    rotation = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    axes = [[a * scales[k] for a in lens.rotated(*(rotation[j][k] for j in range(3)))] for k in range(3)]
    held_x = code.minimum(code.maximum(at.slope_x, lens[_BOUNDS]), lens[_BOUNDS + 1])
    held_y = code.minimum(code.maximum(at.slope_y, lens[_BOUNDS + 2]), lens[_BOUNDS + 3])
    jacobian_x, jacobian_y = lens[_FX] * at.inverse_z, lens[_FY] * at.inverse_z
    row_x = [jacobian_x * (axis[0] - held_x * axis[2]) for axis in axes]
    row_y = [jacobian_y * (axis[1] - held_y * axis[2]) for axis in axes]
    xx, yy, normal = dot(row_x, row_x), dot(row_y, row_y), cross(row_x, row_y)
    # xx yy - xy xy of long thin Gaussians would lose its digits; Lagrange's identity does not.
    dilation = lens[_DILATION]
    determinant = dot(normal, normal) + dilation * (xx + yy) + dilation * dilation
    return SimpleNamespace(
        scales=scales,
        free=free,
        quaternion=(w, x, y, z),
        inverse_norm=inverse_norm,
        has_length=length2 > 2.0 * _TINY,
        rotation=rotation,
        axes=axes,
        held_x=held_x,
        held_y=held_y,
        jacobian_x=jacobian_x,
        jacobian_y=jacobian_y,
        row_x=row_x,
        row_y=row_y,
        xx=xx + dilation,
        xy=dot(row_x, row_y),
        yy=yy + dilation,
        determinant=determinant,
    )


def factor(code: Code, shape: SimpleNamespace) -> tuple[Value, Value, Value, Value]:
    """a, b and c of the quadratic form's factor, and whether the covariance can be inverted."""
    sound = (shape.xx < _LARGEST_VARIANCE_PX2) & (shape.yy < _LARGEST_VARIANCE_PX2)
    inverse_c = math.sqrt(FORM_SCALE) / code.sqrt(shape.yy)
    stretch = 1.0 / code.sqrt(shape.determinant)
    return shape.yy * inverse_c * stretch, -(shape.xy * inverse_c * stretch), inverse_c, sound


def dot(a: list[Value], b: list[Value]) -> Value:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: list[Value], b: list[Value]) -> list[Value]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def view_direction(code: Code, lens: Lens, mean: list[Value]) -> tuple[list[Value], Value]:
    """The unit vector from the camera to the mean, and 1 / their distance."""
    offset = [mean[k] - lens[_CENTRE + k] for k in range(3)]
    inverse = 1.0 / code.sqrt(dot(offset, offset) + _TINY)
    return [a * inverse for a in offset], inverse


def unbounded_colour(code: Code, chunk: Value, direction: list[Value], degree: Value) -> list[Value]:
    """The harmonics' sum plus 1/2 for each channel, up to ``degree`` (a scalar)."""
    basis = basis_values(*direction)
    channels = []
    for c in range(3):
        channels.append(code.variable(parameter(code, chunk, HARMONICS + c) * basis[0] + 0.5))
    for band in range(1, 4):
        with code.when(degree >= band):
            for c in range(3):
                for k in range(band**2, (band + 1) ** 2):
                    channels[c].add(basis[k] * parameter(code, chunk, HARMONICS + 3 * k + c))
    return [channel.get() for channel in channels]


def visible_colour(code: Code, colour: Value) -> Value:
    """Not below 0, and finite."""
    return code.minimum(code.maximum(colour, 0.0), _LARGEST_COLOUR)


def _tiles(code: Code, centre: Value, extent: Value, size: Value) -> Value:
    """The first tile between the pixels centre - extent and + extent, and the last above 16 bits."""

    def tile_at(px: Value) -> Value:
        return code.to_integers(code.maximum(code.minimum(px - 0.5, size - 1.0), 0.0)) >> TILE_SHIFT

    return code.as_floats(tile_at(centre - extent) | (tile_at(centre + extent) << 16))


@vector_kernel(int64(int64, int64, int64, int64, int64))
def project_chunk(
    code: Code, chunk: Value, chunk_bytes: Value, degree: Value, lens_address: Value, records: Value
) -> Value:
    """Write the records of a chunk; returns the visible Gaussians as bits."""
    for row in range(HARMONICS):
        code.prefetch(chunk + chunk_bytes + VECTOR_BYTES * row)  # of the next chunk
    lens = Lens.load(code, lens_address)
    at = point_on_screen(code, lens, chunk)
    visible = code.variable(code.long(0))
    with code.when(code.bits(at.ahead).differs(0)):
        _, log2_opacity = sigmoid(code, parameter(code, chunk, LOGIT_OPACITY))
        eighth = log2_opacity * 0.125
        shape = ellipsoid_on_screen(code, lens, chunk, at)
        a, b, c, sound = factor(code, shape)
        u = lens[_FX] * at.slope_x + lens[_CX]
        v = lens[_FY] * at.slope_y + lens[_CY]
        reach = code.maximum((eighth - EIGHTH_SMALLEST) * (1.0 / FORM_SCALE), 0.0)
        extent_x, extent_y = code.sqrt(reach * shape.xx), code.sqrt(reach * shape.yy)
        seen = at.ahead & sound & (eighth > EIGHTH_SMALLEST)
        seen = seen & (u + extent_x > 0.5) & (u - extent_x < lens[WIDTH] - 0.5)
        seen = seen & (v + extent_y > 0.5) & (v - extent_y < lens[HEIGHT] - 0.5)
        visible.set(code.bits(seen))
        with code.when(visible.get().differs(0)):
            direction, _ = view_direction(code, lens, at.mean)
            colour = [visible_colour(code, x) for x in unbounded_colour(code, chunk, direction, degree)]
            skew = shape.xy * extent_x / shape.xx
            fields = [u, v, a, b, c, eighth, *colour, at.point[2], extent_y, skew, 1.0 / a]
            fields += [_tiles(code, u, extent_x, lens[WIDTH]), _tiles(code, v, extent_y, lens[HEIGHT])]
            rows = fields + [code.vector(0.0)] * (16 - len(fields))
            for lane, record in enumerate(transposed(rows)):
                code.store(records + RECORD_BYTES * lane, record)
    return visible.get()


@parallel_kernel
def project(chunks, count, chunk_bytes, degree, lens, records, visible, threads):
    """Fill the records of the ``count`` chunks at the address ``chunks``, and ``visible``.

    ``lens`` and ``records`` are addresses; ``visible`` (count,) int32 gets the bits of the
    Gaussians that can show in the image; the records of the others mean nothing.
    """
    each = turns((count + BLOCK - 1) // BLOCK, 1, threads)
    for number in prange(each * threads):
        block = dealt(number, each, 1, threads)
        state = flush_denormals()
        for i in range(block * BLOCK, min(count, (block + 1) * BLOCK)):
            visible[i] = project_chunk(
                chunks + i * chunk_bytes, chunk_bytes, degree, lens, records + i * 16 * RECORD_BYTES
            )
        restore_denormals(state)
