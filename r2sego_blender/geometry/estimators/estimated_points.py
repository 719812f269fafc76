"""The points of M_obs that an estimate gives: of the captures that it carries."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...captures.capture import Capture
from ...captures.sensors.cleaning import normals
from ...core.images import resize
from ..stereo.observed import one_a_voxel
from ..stereo.observed_geometry import ObservedGeometry
from .aligned_depth import AlignedDepth, certainty_of

_MOST = 0.5


def with_estimates(
    observed: ObservedGeometry,
    captures: Sequence[Capture],
    estimates: Sequence[AlignedDepth],
    carried: np.ndarray,
    spacing_m: float,
) -> ObservedGeometry:
    """``observed`` and the estimated points of the captures that are ``carried`` (N,) bool, one a voxel.

    Each is seen by its own capture alone, and as sure as the estimate is certain.
    """
    for index in np.flatnonzero(carried):
        one = estimates[index]
        facing, cosine = normals(one.depth, one.camera)
        mask = cosine > 0.0
        image = resize(captures[index].image(), one.camera.width, one.camera.height)
        parts = one.camera.unproject(one.depth)[mask], facing[mask], image[mask], certainty_of(one.sigma[mask])
        points, directions, colours, confidence, _ = one_a_voxel(*parts, spacing_m)
        seen = np.zeros((len(points), len(captures)), bool)
        seen[:, index] = True
        told = ObservedGeometry(points, directions, colours, seen, confidence, estimated=np.ones(len(points), bool))
        observed = observed.joined(told)
    return observed


def spread_m(observed: ObservedGeometry, estimates: Sequence[AlignedDepth], carried: np.ndarray) -> float:
    """How far off the estimated points of ``carried`` (N,) bool captures are, one standard deviation; 0 where most
    points are not estimated."""
    if observed.estimated.sum() < _MOST * len(observed.points):
        return 0.0
    views = [estimates[index] for index in np.flatnonzero(carried)]
    together = np.concatenate([np.zeros(0), *((one.depth * one.sigma)[one.depth > 0.0] for one in views)])
    return float(np.median(together)) if len(together) else 0.0
