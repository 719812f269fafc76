"""Quaternions wxyz and rotation matrices, as arrays."""

from __future__ import annotations

import numpy as np

_SHORTEST, _LONGEST = 1e-9, 1e9
"""Beyond these float32 has no square of a quaternion's length, or no digits of it."""


def unit_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """(N, 4) float64 wxyz of length 1; a quaternion of length zero counts as the identity."""
    quaternions = np.asarray(quaternions, np.float64)
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    return np.where(lengths < 1e-12, identity, quaternions / np.maximum(lengths, 1e-12))


def of_usable_length(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (N, 4) float32, finite, with those that float32 cannot give length 1 of that length already.

    The same array where there are none such.
    """
    with np.errstate(over="ignore"):
        squared = np.einsum("ij,ij->i", quaternions, quaternions)
    odd = (squared < _SHORTEST**2) | (squared > _LONGEST**2)
    if not odd.any():
        return quaternions
    usable = quaternions.copy()
    usable[odd] = unit_quaternions(quaternions[odd])
    return usable


def from_rotation(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions wxyz (..., 4) float64 of rotation matrices (..., 3, 3)."""
    from scipy.spatial.transform import Rotation  # Blender's Python lists the formats without it

    rotations = np.asarray(rotations, np.float64)
    xyzw = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat()
    return np.roll(xyzw, 1, axis=-1).reshape(*rotations.shape[:-2], 4)


def to_rotation(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (N, 3, 3) float64 of quaternions wxyz (N, 4), not all zero."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(np.asarray(quaternions, np.float64), -1, axis=-1)).as_matrix()


def principal_axes(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variances (N, 3), the smallest first, and axes (N, 3, 3), right-handed columns, of (N, 3, 3)."""
    variances, axes = np.linalg.eigh(covariances)
    axes[:, :, 0] *= np.sign(np.linalg.det(axes))[:, None]
    return variances, axes


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The Hamilton product a*b (..., 4): the rotation b, then a."""
    aw, ax, ay, az = np.moveaxis(np.asarray(a, np.float64), -1, 0)
    bw, bx, by, bz = np.moveaxis(np.asarray(b, np.float64), -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )
