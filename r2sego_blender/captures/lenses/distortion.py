"""Distortion of lenses on normalised image coordinates, by the names COLMAP gives the models.

``opencv`` has OpenCV's coefficients ``(k1, k2, p1, p2, k3, k4, k5, k6)``, ``opencv_fisheye``
its fisheye's ``(k1, k2, k3, k4)``; ``brown`` ``(k1, k2, p1, p2, k3, k4)`` with a polynomial of
four terms, as nerfstudio and Metashape have it; the others those of COLMAP's
``sensor/models.h`` after the focal lengths and the principal point. All act before focal
lengths in pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

_ITERATIONS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
_BLOCK = 1 << 16
_NEWTON_STEPS = 50
_NEWTON_SPAN = 1e-6
# Beyond this angle from its axis a ray has no useful place at z = 1.
_WIDEST_RAD = np.radians(89.0)

COEFFICIENTS = {
    "opencv": 8,
    "opencv_fisheye": 4,
    "brown": 6,
    "fov": 1,
    "division": 1,
    "eucm": 2,
    "thin_prism_fisheye": 8,
    "rad_tan_thin_prism_fisheye": 12,
}
"""Model -> how many coefficients it has; missing ones are zero."""


def distorted(model: str, coefficients: Sequence[float], rays: np.ndarray) -> np.ndarray:
    """Image coordinates (n, 2) of camera-frame rays (n, 2) with z = 1."""
    # OpenCV's fisheye takes a view with gaps, such as two of three columns, for one without.
    rays, k = np.ascontiguousarray(rays, np.float64).reshape(-1, 2), _filled(model, coefficients)
    points = rays.reshape(-1, 1, 2)
    if model == "opencv":
        solid = np.concatenate([points, np.ones((len(points), 1, 1))], axis=2)
        found = np.empty_like(rays)
        for start in range(0, len(solid), _BLOCK):  # OpenCV makes a Jacobian of 288 bytes a point too
            block = slice(start, start + _BLOCK)
            placed = cv2.projectPoints(solid[block], np.zeros(3), np.zeros(3), np.eye(3), k)[0]
            found[block] = placed.reshape(-1, 2)
        return found
    if model == "opencv_fisheye":
        return cv2.fisheye.distortPoints(points, np.eye(3), k).reshape(-1, 2)
    radius2 = (rays**2).sum(axis=1, keepdims=True)
    if model == "fov":
        radius = np.maximum(np.sqrt(radius2), 1e-12)
        return rays * np.arctan(2.0 * radius * np.tan(k[0] / 2.0)) / (radius * k[0]) if k[0] else rays
    if model == "division":
        return rays * 2.0 / (1.0 + np.sqrt(1.0 - 4.0 * k[0] * radius2))
    if model == "eucm":
        return rays / (k[0] * np.sqrt(k[1] * radius2 + 1.0) + 1.0 - k[0])
    if model == "brown":
        return _thin_prism(rays, k)
    radius = np.maximum(np.sqrt(radius2), 1e-12)
    return _ANGULAR[model](rays * np.arctan(radius) / radius, k)


def undistorted(model: str, coefficients: Sequence[float], places: np.ndarray) -> np.ndarray:
    """Rays (n, 2) with z = 1 of image coordinates (n, 2); NaN or wrong where there is none."""
    places, k = np.ascontiguousarray(places, np.float64).reshape(-1, 2), _filled(model, coefficients)
    points = places.reshape(-1, 1, 2)
    if model == "opencv":
        found = cv2.undistortPointsIter(points, np.eye(3), k, np.eye(3), np.eye(3), _ITERATIONS)
        return found.reshape(-1, 2)
    if model == "opencv_fisheye":
        return cv2.fisheye.undistortPoints(points, np.eye(3), k, criteria=_ITERATIONS).reshape(-1, 2)
    radius2 = (places**2).sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        if model == "fov":
            if k[0] == 0.0:
                return places
            radius = np.maximum(np.sqrt(radius2), 1e-12)
            angle = np.where(radius * k[0] < _WIDEST_RAD, radius * k[0], np.nan)
            return places * np.tan(angle) / (2.0 * radius * np.tan(k[0] / 2.0))
        if model == "division":
            return places / np.where(1.0 + k[0] * radius2 > 0, 1.0 + k[0] * radius2, np.nan)
        if model == "eucm":
            inner = np.sqrt(1.0 - (2.0 * k[0] - 1.0) * k[1] * radius2)
            depth = (1.0 - k[1] * k[0] ** 2 * radius2) / (k[0] * inner + 1.0 - k[0])
            return places / np.where(depth > 0, depth, np.nan)
        if model == "brown":
            return _solved(lambda guess: _thin_prism(guess, k), places)
        angles = _solved(lambda guess: _ANGULAR[model](guess, k), places)
        angle = np.maximum(np.linalg.norm(angles, axis=1, keepdims=True), 1e-12)
        return angles * np.tan(np.where(angle < _WIDEST_RAD, angle, np.nan)) / angle


def turned(model: str, coefficients: Sequence[float]) -> tuple[float, ...]:
    """The coefficients after a clockwise quarter turn of the image: (x, y) goes to (-y, x)."""
    k = list(coefficients)
    if model in _ANGULAR:
        k += [0.0] * (COEFFICIENTS[model] - len(k))
    if model in ("opencv", "brown", "thin_prism_fisheye") and len(k) >= 4:
        # The tangential terms act along (p2, p1), which turns with the image.
        k[2], k[3] = k[3], -k[2]
    if model == "thin_prism_fisheye":
        k[6], k[7] = -k[7], k[6]
    if model == "rad_tan_thin_prism_fisheye":
        k[6], k[7] = -k[7], k[6]
        k[8:12] = -k[10], -k[11], k[8], k[9]
    return tuple(k)


def _thin_prism(angles: np.ndarray, k: np.ndarray) -> np.ndarray:
    """COLMAP's THIN_PRISM_FISHEYE of ``angle * direction`` (n, 2): k1, k2, p1, p2, k3, k4, sx1, sy1.

    Without the last two, and of rays, it is the model ``brown``.
    """
    k = np.append(k, [0.0] * (8 - len(k)))
    x, y = angles.T
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[4] + r2 * k[5])))
    return np.stack(
        [
            x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x) + k[6] * r2,
            y * radial + 2.0 * k[3] * x * y + k[2] * (r2 + 2.0 * y * y) + k[7] * r2,
        ],
        axis=1,
    )


def _rad_tan_thin_prism(angles: np.ndarray, k: np.ndarray) -> np.ndarray:
    """COLMAP's RAD_TAN_THIN_PRISM_FISHEYE: six radial terms, then p0, p1 and s0..s3 on what they give."""
    t2 = (angles**2).sum(axis=1, keepdims=True)
    radial = 1.0 + t2 * np.polynomial.polynomial.polyval(t2, k[:6])
    x, y = (angles * radial).T
    r2 = x * x + y * y
    return np.stack(
        [
            x + k[6] * (r2 + 2.0 * x * x) + 2.0 * k[7] * x * y + r2 * (k[8] + k[9] * r2),
            y + k[7] * (r2 + 2.0 * y * y) + 2.0 * k[6] * x * y + r2 * (k[10] + k[11] * r2),
        ],
        axis=1,
    )


_ANGULAR: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "thin_prism_fisheye": _thin_prism,
    "rad_tan_thin_prism_fisheye": _rad_tan_thin_prism,
}
"""Models that act on the angle from the axis times the direction in the image."""


def _solved(function: Callable[[np.ndarray], np.ndarray], targets: np.ndarray) -> np.ndarray:
    """Where a smooth map of the plane (n, 2), near the identity, gives ``targets``: Newton's method."""
    found = targets.copy()
    for _ in range(_NEWTON_STEPS):
        residual = function(found) - targets
        slopes = [
            (function(found + step) - function(found - step)) / (2.0 * _NEWTON_SPAN)
            for step in _NEWTON_SPAN * np.eye(2)
        ]
        (a, c), (b, d) = slopes[0].T, slopes[1].T
        determinant = a * d - b * c
        determinant = np.where(np.abs(determinant) > 1e-9, determinant, np.nan)
        u, v = residual.T
        change = np.stack([d * u - b * v, a * v - c * u], axis=1) / determinant[:, None]
        found = found - change
        if not np.nanmax(np.abs(change), initial=0.0) > 1e-13:
            break
    return found


def _filled(model: str, coefficients: Sequence[float]) -> np.ndarray:
    count = COEFFICIENTS[model]
    return np.array((*coefficients, *[0.0] * count)[:count], np.float64)
