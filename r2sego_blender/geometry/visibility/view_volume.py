"""What a view can see at all: the planes that bound it, and the spheres that reach into it."""

from __future__ import annotations

import numpy as np

from ...core.compiled import kernel
from .projection import NEAR_M


@kernel
def side_planes(lens, width, height):
    """(4, 3): the unit normals, inwards, of the planes through the camera and the image's sides.

    ``lens`` is fx, fy, cx, cy in pixels of the ``width`` x ``height`` image.
    """
    planes = np.zeros((4, 3))
    planes[0] = 1.0, 0.0, lens[2] / lens[0]
    planes[1] = -1.0, 0.0, (width - lens[2]) / lens[0]
    planes[2] = 0.0, 1.0, lens[3] / lens[1]
    planes[3] = 0.0, -1.0, (height - lens[3]) / lens[1]
    for k in range(4):
        planes[k] /= np.sqrt((planes[k] ** 2).sum())
    return planes


@kernel
def in_view(pose, planes, sphere):
    """Whether a sphere (centre, radius; metres, world) may reach into the view.

    ``pose`` (3, 4) is camera_from_world, ``planes`` are ``side_planes`` of its lens.
    """
    x = pose[0, 0] * sphere[0] + pose[0, 1] * sphere[1] + pose[0, 2] * sphere[2] + pose[0, 3]
    y = pose[1, 0] * sphere[0] + pose[1, 1] * sphere[1] + pose[1, 2] * sphere[2] + pose[1, 3]
    z = pose[2, 0] * sphere[0] + pose[2, 1] * sphere[1] + pose[2, 2] * sphere[2] + pose[2, 3]
    reach = sphere[3] + NEAR_M
    if z < -sphere[3]:
        return False
    for k in range(planes.shape[0]):  # noqa: SIM110  (Numba knows no generators)
        if planes[k, 0] * x + planes[k, 1] * y + planes[k, 2] * z < -reach:
            return False
    return True
