"""The scale of a room from sensor depth: metres for each unit of the triangulated points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...bundle.layout import mask_stems
from ...core.errors import CaptureError
from ...core.statistics import weighted_median
from ..capture import Capture
from ..sensors.sampling import sampled
from ..sensors.sensor_depth import SensorDepth
from ..sparse_points import SparsePoints

# What a sensor is off by, and how well a feature is placed.
_SENSOR_SIGMA = 0.01
_FEATURE_SIGMA_PX = 0.7
_FEWEST_POINTS = 30
_FEWEST_A_CAPTURE = 5
_LARGEST_SPREAD = 0.2
_TO_SIGMA = 1.4826  # of a median absolute deviation
_UNITS_M = (0.001, 1 / 5000, 1 / 4000, 1 / 6553.5, 1 / 256, 0.0001, 0.01)
"""Of public depth maps: millimetres, TUM RGB-D and ICL-NUIM, RealSense L515, Replica, KITTI, tenths and ten
millimetres."""
_SAME_UNIT = 0.08


@dataclass(frozen=True)
class DepthScale:
    """Metres per unit, and how sure that is.

    ``spread`` is the robust relative standard deviation of a single point's ratio,
    ``uncertainty`` that of the scale, counting a capture as one measurement: its points share
    the errors of its pose and of the sensor. ``points`` ratios in ``captures`` captures.
    """

    metres_per_unit: float
    spread: float
    uncertainty: float
    points: int
    captures: int

    def __str__(self) -> str:
        return (
            f"sensor depth at {self.points} points in {self.captures} captures, spread "
            f"{self.spread:.1%}, sure to {self.uncertainty:.1%}"
        )


def depth_scale(captures: Sequence[Capture], sparse: SparsePoints, depth: SensorDepth) -> DepthScale:
    """The median ratio of sensor depth to triangulated depth, over all measurements.

    Each counts by how well it is measured: a point seen under a narrow angle has an unsure
    depth. Raises CaptureError when too few captures have depth, or their ratios disagree.
    """
    ratios, weights, owners = [], [], []
    maps = 0
    sine = sparse.widest_sine([capture.camera.centre for capture in captures])
    stems = mask_stems([capture.name for capture in captures])
    for index, capture in enumerate(captures):
        map_m = depth.of(capture, stems[capture.name])
        if map_m is None:
            continue
        maps += 1
        rows = np.flatnonzero(sparse.visibility[:, index] & (sine > 0))
        measured = sampled(map_m, capture.photograph_shares(sparse.pixels[rows, index]))
        triangulated = capture.camera.project(sparse.points[rows])[1]
        good = (measured > 0) & (triangulated > 0)
        if good.sum() < _FEWEST_A_CAPTURE:
            continue
        ratios.append(np.log(measured[good] / triangulated[good]))
        relative = _FEATURE_SIGMA_PX / (capture.camera.fx * sine[rows[good]])
        weights.append(1.0 / (_SENSOR_SIGMA**2 + relative**2))
        owners.append(index)
    count = sum(map(len, ratios))
    if count < _FEWEST_POINTS:
        raise CaptureError(
            f"only {count} points were measured in {maps} depth map{'s' if maps != 1 else ''} of "
            f"{len(captures)} captures",
            where=depth.folder,
            cure=f"Call depth maps as the photographs, such as {next(iter(stems.values()))}.png, and give "
            "those of at least two.",
        )
    together, weight = np.concatenate(ratios), np.concatenate(weights)
    centre = weighted_median(together, weight)
    spread = _TO_SIGMA * weighted_median(np.abs(together - centre), weight)
    if spread > _LARGEST_SPREAD:
        raise CaptureError(
            f"sensor depth and triangulated depth disagree: their ratio varies by {spread:.0%}",
            where=depth.folder,
            cure="Check that the depth maps belong to the photographs, are planar depth and in "
            "millimetres (16-bit) or metres (float).",
        )
    medians = np.array([weighted_median(*pair) for pair in zip(ratios, weights, strict=True)])
    among = _TO_SIGMA * float(np.median(np.abs(medians - centre)))
    uncertainty = max(among, spread) / np.sqrt(len(medians))
    return DepthScale(float(np.exp(centre)), float(spread), float(uncertainty), count, len(owners))


def likely_unit_m(given_m: float, times_too_large: float) -> float | None:
    """The unit, of those that depth maps have, in which what ``given_m`` reads so much too large is right.

    None where none fits within a few percent.
    """
    wanted = given_m / times_too_large
    nearest = min(_UNITS_M, key=lambda unit: abs(np.log(unit / wanted)))
    return nearest if abs(np.log(nearest / wanted)) < _SAME_UNIT and nearest != given_m else None
