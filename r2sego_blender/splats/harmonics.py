"""Real spherical harmonics of degree 0 to 3 in the order and signs of 3DGS."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.errors import AssetError

SH_BAND_0 = 0.28209479177387814
"""The constant harmonic: colour = SH_BAND_0 * sh[:, 0] + 0.5."""
_B1 = 0.4886025119029199
_B2A, _B2B, _B2C = 1.0925484305920792, 0.31539156525252005, 0.5462742152960396
_B3A, _B3B = 0.5900435899266435, 2.890611442640554
_B3C, _B3D, _B3E = 0.4570457994644658, 0.3731763325901154, 1.445305721320277


def degree_of(coefficients: int) -> int:
    """The degree that has this number of coefficients a channel."""
    return round(coefficients**0.5) - 1


def basis_values(x: Any, y: Any, z: Any) -> list[Any]:
    """The sixteen harmonics of a unit direction, for anything that has Python's operators."""
    xx, yy, zz = x * x, y * y, z * z
    return [
        SH_BAND_0,
        -_B1 * y,
        _B1 * z,
        -_B1 * x,
        _B2A * x * y,
        -_B2A * y * z,
        _B2B * (2.0 * zz - xx - yy),
        -_B2A * x * z,
        _B2C * (xx - yy),
        -_B3A * y * (3.0 * xx - yy),
        _B3B * x * y * z,
        -_B3C * y * (4.0 * zz - xx - yy),
        _B3D * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -_B3C * x * (4.0 * zz - xx - yy),
        _B3E * z * (xx - yy),
        -_B3A * x * (xx - 3.0 * yy),
    ]


def basis_gradients(x: Any, y: Any, z: Any) -> list[tuple[Any, Any, Any]]:
    """For each harmonic its derivatives in x, y and z, None where it has none."""
    xx, yy, zz = x * x, y * y, z * z
    xy, yz, xz = x * y, y * z, x * z
    return [
        (None, None, None),
        (None, -_B1, None),
        (None, None, _B1),
        (-_B1, None, None),
        (_B2A * y, _B2A * x, None),
        (None, -_B2A * z, -_B2A * y),
        (-2.0 * _B2B * x, -2.0 * _B2B * y, 4.0 * _B2B * z),
        (-_B2A * z, None, -_B2A * x),
        (2.0 * _B2C * x, -2.0 * _B2C * y, None),
        (-6.0 * _B3A * xy, -3.0 * _B3A * (xx - yy), None),
        (_B3B * yz, _B3B * xz, _B3B * xy),
        (2.0 * _B3C * xy, -_B3C * (4.0 * zz - xx - 3.0 * yy), -8.0 * _B3C * yz),
        (-6.0 * _B3D * xz, -6.0 * _B3D * yz, 3.0 * _B3D * (2.0 * zz - xx - yy)),
        (-_B3C * (4.0 * zz - 3.0 * xx - yy), 2.0 * _B3C * xy, -8.0 * _B3C * xz),
        (2.0 * _B3E * xz, -2.0 * _B3E * yz, _B3E * (xx - yy)),
        (-3.0 * _B3A * (xx - yy), 6.0 * _B3A * xy, None),
    ]


def basis(directions: np.ndarray, degree: int) -> np.ndarray:
    """(N, (degree+1)**2) float64, the harmonics at unit ``directions`` (N, 3)."""
    values = basis_values(*np.asarray(directions, np.float64).T)[: (degree + 1) ** 2]
    return (
        np.stack(np.broadcast_arrays(*values), axis=1) if len(values) > 1 else np.full((len(directions), 1), SH_BAND_0)
    )


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
