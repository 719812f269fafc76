"""How steady a clip is: what a surface's colour does from one frame to the next."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from r2sego_blender.core.cameras import Camera

_VISIBLE = 0.01  # relative difference of depths at which the next frame still shows the point


def flow_differences(
    images: Sequence[np.ndarray], cameras: Sequence[Camera], depths: Sequence[np.ndarray]
) -> np.ndarray:
    """(F - 1,) float64: mean absolute difference of consecutive frames along the proxy's flow.

    ``images`` (H, W, 3) in [0, 1] with the proxy's planar ``depths`` (H, W) in metres. Every
    surface point of a frame that the next one shows too is compared with it there, bilinear.
    Sampling between pixels is part of the figure, so sharp frames do not reach 0.
    """
    found = []
    for t in range(len(images) - 1):
        camera, after = cameras[t], cameras[t + 1]
        pixels, z = after.project(camera.unproject(depths[t]))
        visible = (depths[t] > 0.0) & after.sees(pixels, z, margin_px=1.0)
        place = np.where(visible[..., None], pixels, 0.0).astype(np.float32) - np.float32(0.5)
        there = cv2.remap(depths[t + 1], place[..., 0], place[..., 1], cv2.INTER_NEAREST)
        visible &= np.abs(there - z) < _VISIBLE * z
        colour = cv2.remap(images[t + 1], place[..., 0], place[..., 1], cv2.INTER_LINEAR)
        difference = np.abs(colour - images[t])[visible]
        found.append(float(difference.mean(dtype=np.float64)) if difference.size else 0.0)
    return np.array(found)
