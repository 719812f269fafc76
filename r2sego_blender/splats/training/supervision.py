"""Supervision of an asset's depth by known geometry: its distance, and its slope by normals.

Both work on the expected depth D = depth_sum / alpha of a rendering and give gradients in
depth_sum and alpha. The distance term is the mean of |D - d| / d over pixels of known depth
d. The slope term needs no normals of Gaussians: on a plane with the normal n at pixel p,
D(q) n.ray(q) is the same at p and at its neighbours q, so the mean of

    |D(q) n(p).ray(q) - D(p) n(p).ray(p)| / (D(p) |n(p).ray(p)|)

over the neighbours to the right and below is 0 exactly when the depth runs as n says.
"""

from __future__ import annotations

import numpy as np

from ...config.training_settings import TrainingSettings
from ...core.cameras import Camera

_SMALLEST_ALPHA = 0.5
"""Where less is covered, the expected depth is of no use."""

_SMALLEST_COSINE = 0.1
"""Of the angle between ray and normal: nearer to edge-on, a slope says too little."""

_LARGEST_STEP = 0.1
"""Relative depth difference of neighbours above which an edge lies between them."""


def depth_gradients(
    depth_sum: np.ndarray,
    alpha: np.ndarray,
    camera: Camera,
    depth: np.ndarray,
    weight: np.ndarray,
    normals: np.ndarray | None,
    settings: TrainingSettings,
) -> tuple[float, np.ndarray, np.ndarray]:
    """The loss, and its gradients (H, W) float32 in ``depth_sum`` and ``alpha``.

    ``depth`` (H, W) planar metres, 0 unknown; ``weight`` (H, W) in [0, 1]; ``normals``
    (H, W, 3) in the camera frame, 0 unknown. The loss is the sum of ``depth_weight`` and
    ``normal_weight`` times their terms, means over all pixels of the image.
    """
    covered = alpha > _SMALLEST_ALPHA
    expected = np.where(covered, depth_sum / np.where(covered, alpha, 1.0), 0.0)
    loss, gradient = 0.0, np.zeros_like(expected)
    if settings.depth_weight > 0.0:
        share = settings.depth_weight / depth.size * weight * (covered & (depth > 0.0))
        share = share / np.where(depth > 0.0, depth, 1.0)
        loss += float((share * np.abs(expected - depth)).sum())
        gradient += share * np.sign(expected - depth)
    if settings.normal_weight > 0.0 and normals is not None:
        along = camera.rays().astype(np.float32)
        for axis in (0, 1):
            term, slope = _slope_term(expected, covered, along, normals, weight, axis)
            loss += settings.normal_weight / depth.size * term
            gradient += settings.normal_weight / depth.size * slope
    by_sum = np.where(covered, gradient / np.where(covered, alpha, 1.0), 0.0)
    return loss, by_sum.astype(np.float32), (-by_sum * expected).astype(np.float32)


def _slope_term(
    expected: np.ndarray, covered: np.ndarray, rays: np.ndarray, normals: np.ndarray, weight: np.ndarray, axis: int
) -> tuple[float, np.ndarray]:
    """The sum over neighbours along ``axis``, and its gradient in the expected depth."""
    here = tuple(slice(None, -1) if k == axis else slice(None) for k in range(2))
    there = tuple(slice(1, None) if k == axis else slice(None) for k in range(2))
    normal = normals[here]
    own = (normal * rays[here]).sum(axis=-1)
    other = (normal * rays[there]).sum(axis=-1)
    near, far = expected[here], expected[there]
    usable = covered[here] & covered[there] & (np.abs(own) > _SMALLEST_COSINE)
    usable &= np.abs(far - near) < _LARGEST_STEP * near
    scale = np.where(usable, weight[here] / np.where(usable, near * np.abs(own), 1.0), 0.0)
    residual = far * other - near * own
    total = float((scale * np.abs(residual)).sum())
    sign = scale * np.sign(residual)
    gradient = np.zeros_like(expected)
    gradient[there] += sign * other
    # |residual| / near: the quotient's own derivative as well.
    gradient[here] -= sign * own + np.where(usable, scale * np.abs(residual) / np.where(usable, near, 1.0), 0.0)
    return total, gradient
