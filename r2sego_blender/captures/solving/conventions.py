"""Which reading of given poses, and which focal length, the photographs' matches agree with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...core.cameras import Camera
from ..matching.features import Features, epipolar_errors
from ..matching.overlap import Pairs

_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
# Factors of the focal length that are tried: a fifth to five times, 4 % apart.
_FACTORS = np.exp(np.arange(-41, 42) * 0.04)
# So much more agreement than with the given lens tells another one.
_CLEARLY_MORE = 1.02
# Of matches between right poses most agree with them, with others few: a third where all cameras look the
# same way round something.
_FITS_SHARE, _CONTRADICTS_SHARE, _MORE_SHARE = 0.6, 0.6, 0.3
# Matches of a pair looked at: a scan needs no more.
_MOST_OF_PAIR = 100


def agreement(pairs: Pairs, features: Sequence[Features], cameras: Sequence[Camera], width_px: float) -> float:
    """0 to 1: the mean of ``1 / (1 + (e / width)^2)`` over the epipolar errors of matches."""
    total, count = 0.0, 0
    for (i, j), matches in pairs.items():
        thinned = matches[:: max(1, len(matches) // _MOST_OF_PAIR)]
        places = features[i].keypoints[thinned[:, 0]], features[j].keypoints[thinned[:, 1]]
        errors = epipolar_errors(*places, cameras[i], cameras[j])
        total += float((1.0 / (1.0 + np.square(errors / width_px))).sum())
        count += len(errors)
    return total / max(count, 1)


def zoomed(camera: Camera, factor: float) -> Camera:
    """The camera with its focal lengths times ``factor``."""
    return replace(camera, fx=camera.fx * factor, fy=camera.fy * factor)


def focal_factor(pairs: Pairs, features: Sequence[Features], cameras: Sequence[Camera], width_px: float) -> float:
    """The factor of all focal lengths under which most matches agree with the poses; 1 unless clearly more do."""

    def agreeing(factor: float) -> float:
        return agreement(pairs, features, [zoomed(camera, factor) for camera in cameras], width_px)

    scores = [agreeing(factor) for factor in _FACTORS]
    best = int(np.argmax(scores))
    return float(_FACTORS[best]) if scores[best] > _CLEARLY_MORE * agreeing(1.0) else 1.0


def fitting_convention(
    pairs: Pairs, features: Sequence[Features], cameras: Sequence[Camera], width_px: float
) -> str | None:
    """What the poses are in truth, in words, where matches contradict them as they were read; None where
    nothing usual fits.

    The axes of the world do not matter to matches: what is left are the camera's axes and the direction.
    """
    given = agreement(pairs, features, cameras, width_px)
    if given > _CONTRADICTS_SHARE:
        return None
    readings = {
        "the other camera axes (y and z turned round: OpenGL's where OpenCV's were expected, or the reverse)": (
            lambda pose: pose @ _OPENGL
        ),
        "the inverse (camera_from_world where world_from_camera was expected)": np.linalg.inv,
        "the inverse with the other camera axes (camera_from_world, y and z turned round)": (
            lambda pose: np.linalg.inv(pose) @ _OPENGL
        ),
    }
    scores = {
        name: agreement(pairs, features, [camera.at(read(camera.world_from_camera)) for camera in cameras], width_px)
        for name, read in readings.items()
    }
    best = max(scores, key=lambda name: scores[name])
    return best if scores[best] > max(_FITS_SHARE, given + _MORE_SHARE) else None
