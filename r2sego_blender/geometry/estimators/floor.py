"""The floor in an estimate: what of it lies on z = 0, where the camera's height above that is all that is known.

An estimate is right up to a scale; of its level surfaces the floor is the lowest, so that at the right scale one
lies on z = 0 and next to nothing under it.
"""

from __future__ import annotations

import numpy as np

from ...core.cameras import Camera

_LEAST_SLOPE = 0.05  # downwards for each metre ahead: floor that is seen flatter is too far off to tell a scale
_LEVEL = 0.85  # cosine between up and the normal of what may be floor: estimates bend it
_REACH = 0.012  # of the longest side, either way: what a normal is made of
_STEP = 0.02  # of the logarithm of the scale
_WITHIN = 0.12  # relative, of what lies on one floor: an estimate is off by a few per cent here and there
_BELOW = 2.0  # what lies below a floor speaks against it so many times as much
_LEAST_SHARE = 0.01  # of the picture that has to be floor


def floor_depth(camera: Camera) -> np.ndarray:
    """(H, W) float64 planar metres to z = 0, 0 where a pixel's ray does not come down to it."""
    down = -(camera.rays() @ camera.world_from_camera[2, :3])
    height = float(camera.centre[2])
    met = (down > _LEAST_SLOPE) & (height > 0.0)
    return np.where(met, height / np.where(met, down, 1.0), 0.0)


def floor_in(depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) float32 metres to the floor where ``depth`` (H, W), in any unit and 0 where unknown, shows it; 0
    elsewhere, and everywhere where it shows none."""
    on_floor = floor_depth(camera)
    asked = (depth > 0.0) & (on_floor > 0.0)
    scales = np.log(np.where(asked, on_floor, 1.0) / np.where(asked, depth, 1.0))
    level = asked & (_upward(camera.unproject(np.where(depth > 0.0, depth, 1.0))) > _LEVEL)
    nothing = np.zeros(depth.shape, np.float32)
    if level.sum() < _LEAST_SHARE * depth.size:
        return nothing
    found, every = np.sort(scales[level]), np.sort(scales[asked])
    tried = np.arange(found[0], found[-1] + _STEP, _STEP)
    on = np.searchsorted(found, tried + _WITHIN) - np.searchsorted(found, tried - _WITHIN)
    below = np.searchsorted(every, tried - _WITHIN)
    best = int(np.argmax(on - _BELOW * below))
    if on[best] < _LEAST_SHARE * depth.size or on[best] <= _BELOW * below[best]:
        return nothing
    there = level & (np.abs(scales - tried[best]) <= _WITHIN)
    return np.where(there, on_floor, 0.0).astype(np.float32)


def _upward(points: np.ndarray) -> np.ndarray:
    """(H, W) cosine between up and the normal of the surface through points (H, W, 3); 0 at the border."""
    r = max(1, round(_REACH * max(points.shape[:2])))
    across = points[r:-r, 2 * r :] - points[r:-r, : -2 * r]
    along = points[2 * r :, r:-r] - points[: -2 * r, r:-r]
    normal = np.cross(along, across)
    length = np.maximum(np.linalg.norm(normal, axis=-1), 1e-12)
    up = np.zeros(points.shape[:2])
    up[r:-r, r:-r] = np.abs(normal[..., 2]) / length
    return up
