"""Quaternions wxyz and rotation matrices, as arrays."""

from __future__ import annotations

import numpy as np


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
