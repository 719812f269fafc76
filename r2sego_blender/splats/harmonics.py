"""Real spherical harmonics of degree 0 to 3 in the order and signs of 3DGS."""

from __future__ import annotations

import numpy as np

from ..errors import AssetError
from .compiled import inlined

_B0 = np.float32(0.28209479177387814)
_B1 = np.float32(0.4886025119029199)
_B2A, _B2B, _B2C = (
    np.float32(1.0925484305920792),
    np.float32(0.31539156525252005),
    np.float32(0.5462742152960396),
)
_B3A, _B3B = np.float32(0.5900435899266435), np.float32(2.890611442640554)
_B3C, _B3D, _B3E = (
    np.float32(0.4570457994644658),
    np.float32(0.3731763325901154),
    np.float32(1.445305721320277),
)
_2, _3, _4, _5, _6 = np.float32(2), np.float32(3), np.float32(4), np.float32(5), np.float32(6)
_8, _10 = np.float32(8), np.float32(10)


def degree_of(coefficients: int) -> int:
    """The degree that has this number of coefficients a channel."""
    return round(coefficients**0.5) - 1


@inlined
def evaluate_basis(x, y, z, coefficients, basis):
    """Write the first ``coefficients`` harmonics of the unit direction into ``basis``."""
    basis[0] = _B0
    if coefficients > 1:
        basis[1] = -_B1 * y
        basis[2] = _B1 * z
        basis[3] = -_B1 * x
    if coefficients > 4:
        basis[4] = _B2A * x * y
        basis[5] = -_B2A * y * z
        basis[6] = _B2B * (_2 * z * z - x * x - y * y)
        basis[7] = -_B2A * x * z
        basis[8] = _B2C * (x * x - y * y)
    if coefficients > 9:
        basis[9] = -_B3A * y * (_3 * x * x - y * y)
        basis[10] = _B3B * x * y * z
        basis[11] = -_B3C * y * (_4 * z * z - x * x - y * y)
        basis[12] = _B3D * z * (_2 * z * z - _3 * x * x - _3 * y * y)
        basis[13] = -_B3C * x * (_4 * z * z - x * x - y * y)
        basis[14] = _B3E * z * (x * x - y * y)
        basis[15] = -_B3A * x * (x * x - _3 * y * y)


@inlined
def direction_gradient(x, y, z, coefficients, g):
    """The gradient in x, y, z of the sum of ``g[k]`` times harmonic k."""
    gx = np.float32(0)
    gy = np.float32(0)
    gz = np.float32(0)
    if coefficients > 1:
        gx -= _B1 * g[3]
        gy -= _B1 * g[1]
        gz += _B1 * g[2]
    if coefficients > 4:
        gx += _B2A * (y * g[4] - z * g[7]) + _2 * x * (_B2C * g[8] - _B2B * g[6])
        gy += _B2A * (x * g[4] - z * g[5]) - _2 * y * (_B2C * g[8] + _B2B * g[6])
        gz += _4 * _B2B * z * g[6] - _B2A * (y * g[5] + x * g[7])
    if coefficients > 9:
        gx += (
            -_6 * _B3A * x * y * g[9]
            + _B3B * y * z * g[10]
            + _2 * _B3C * x * y * g[11]
            - _6 * _B3D * x * z * g[12]
            - _B3C * (_4 * z * z - _3 * x * x - y * y) * g[13]
            + _2 * _B3E * x * z * g[14]
            - _3 * _B3A * (x * x - y * y) * g[15]
        )
        gy += (
            -_3 * _B3A * (x * x - y * y) * g[9]
            + _B3B * x * z * g[10]
            - _B3C * (_4 * z * z - x * x - _3 * y * y) * g[11]
            - _6 * _B3D * y * z * g[12]
            + _2 * _B3C * x * y * g[13]
            - _2 * _B3E * y * z * g[14]
            + _6 * _B3A * x * y * g[15]
        )
        gz += (
            _B3B * x * y * g[10]
            - _8 * _B3C * y * z * g[11]
            + _3 * _B3D * (_2 * z * z - x * x - y * y) * g[12]
            - _8 * _B3C * x * z * g[13]
            + _B3E * (x * x - y * y) * g[14]
        )
    return gx, gy, gz


def basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """(N, (degree+1)**2) float64, the harmonics at unit ``directions`` (N, 3)."""
    x, y, z = np.asarray(directions, np.float64).T
    columns = np.empty((16, len(x)))
    evaluate_basis.py_func(x, y, z, (degree + 1) ** 2, columns)
    return columns[: (degree + 1) ** 2].T


def rotated_coefficients(sh: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Coefficients (N, K, 3) of the functions turned by ``rotation`` (3, 3): f'(R d) = f(d).

    Each band turns within itself. Its matrix follows from the values at fixed directions,
    which determine a band exactly.
    """
    degree = degree_of(sh.shape[1])
    if sh.shape[1] != (degree + 1) ** 2:
        raise AssetError("the harmonics' coefficients are not a full degree", cure="Use 1, 4, 9 or 16.")
    directions = _spread_directions(64)
    turned, original = basis(directions, degree), basis(directions @ rotation, degree)
    result = np.array(sh, np.float32)
    for band in range(1, degree + 1):
        columns = slice(band**2, (band + 1) ** 2)
        matrix = np.linalg.lstsq(turned[:, columns], original[:, columns], rcond=None)[0]
        result[:, columns] = np.einsum("ij,njc->nic", matrix, sh[:, columns])
    return result


def _spread_directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly (a Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle_rad = np.pi * (1.0 + 5.0**0.5) * index
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle_rad), radius * np.sin(angle_rad), z], axis=1)
