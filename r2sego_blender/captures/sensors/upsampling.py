"""Depth of a sensor at a photograph's resolution: upsampled along the photograph's edges.

Joint bilateral upsampling (Kopf et al., SIGGRAPH 2007) with a median in place of the mean: a pixel
takes the depth of those measurements nearby that look like it, and never one between two surfaces.
"""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera
from ...core.compiled import parallel_kernel, prange
from ...core.images import resize
from .sensor_maps import SensorMap

_REACH = 1.6  # half the side of a window of measurements, in their spacing
_SPACE_SIGMA = 0.8  # in their spacing
_COLOUR_SIGMA = 0.08
_MOST = 16  # measurements in a window
_SAME_SURFACE = 0.05  # relative depth within which neighbouring measurements are of one surface


def upsampled(sensor: SensorMap, image: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Depth and its sigma (H, W) float32 for each pixel of ``camera``, 0 where the sensor knows nothing near.

    ``image`` (H, W, 3) float32 is the photograph at ``camera``'s size, which sees what the map does.
    """
    small = np.ascontiguousarray(resize(image, sensor.camera.width, sensor.camera.height), np.float32)
    return _upsampled(
        np.ascontiguousarray(image, np.float32),
        small,
        np.ascontiguousarray(sensor.depth, np.float32),
        np.ascontiguousarray(sensor.sigma, np.float32),
        sensor.camera.width / camera.width,
        sensor.camera.height / camera.height,
    )


@parallel_kernel
def _upsampled(image, small, depth, sigma, per_column, per_row):
    height, width = image.shape[:2]
    rows, columns = depth.shape
    out, out_sigma = np.zeros((height, width), np.float32), np.zeros((height, width), np.float32)
    for row in prange(height):
        values, weights = np.empty(_MOST, np.float32), np.empty(_MOST, np.float32)
        doubts = np.empty(_MOST, np.float32)
        v = (row + 0.5) * per_row - 0.5
        for column in range(width):
            u = (column + 0.5) * per_column - 0.5
            count, total, full = 0, 0.0, 0.0
            for y in range(int(np.ceil(v - _REACH)), int(np.floor(v + _REACH)) + 1):
                for x in range(int(np.ceil(u - _REACH)), int(np.floor(u + _REACH)) + 1):
                    if not (0 <= y < rows and 0 <= x < columns) or count == _MOST:
                        continue
                    apart = ((x - u) ** 2 + (y - v) ** 2) / (_SPACE_SIGMA * _SPACE_SIGMA)
                    off = 0.0
                    for k in range(3):
                        off += (image[row, column, k] - small[y, x, k]) ** 2
                    weight = np.exp(-0.5 * (apart + off / (_COLOUR_SIGMA * _COLOUR_SIGMA))) + 1e-12
                    full += weight
                    if depth[y, x] <= 0.0:
                        continue
                    # Kept in order of depth.
                    k = count
                    while k > 0 and values[k - 1] > depth[y, x]:
                        values[k], weights[k], doubts[k] = values[k - 1], weights[k - 1], doubts[k - 1]
                        k -= 1
                    values[k], weights[k], doubts[k] = depth[y, x], weight, sigma[y, x]
                    count += 1
                    total += weight
            # Where what looks like this pixel was not measured, neither was this pixel.
            if count == 0 or total < 0.5 * full:
                continue
            half, k = 0.0, 0
            while k < count - 1 and half + weights[k] < 0.5 * total:
                half += weights[k]
                k += 1
            # The mean inverse depth, linear on a plane, of the surface that the median lies on.
            middle, doubt, inverse, total = values[k], doubts[k], 0.0, 0.0
            for k in range(count):
                if abs(values[k] - middle) <= _SAME_SURFACE * middle:
                    inverse += weights[k] / values[k]
                    total += weights[k]
            out[row, column] = total / inverse
            out_sigma[row, column] = doubt
    return out, out_sigma
