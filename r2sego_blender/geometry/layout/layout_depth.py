"""Depth of each capture from the room's layout alone: floor, walls and ceiling of a box."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...core.images import resize, resize_nearest
from ...core.progress import SILENT, Progress
from ..estimators.aligned_depth import AlignedDepth
from ..stereo.evidence import KnownDepth
from .box_search import find_box
from .room_box import RoomBox
from .segments import find_segments

_WORKING_PX = 320
_LEAST_SIGMA = 0.05


def layout_depth(
    captures: Sequence[Capture], trusted: Sequence[KnownDepth], progress: Progress = SILENT
) -> tuple[AlignedDepth, ...]:
    """Each capture's depth by the layout of the room they stand in, planar metres, with its relative sigma.

    The captures have their cameras in the world, whose floor is z = 0; ``trusted`` is what is known of depth besides,
    at the size of which the result is, 0 where nothing is. Deterministic.
    """
    cameras = [capture.camera.fitted(_WORKING_PX) for capture in captures]
    images = [resize(one.image(), to.width, to.height) for one, to in zip(captures, cameras, strict=True)]
    known = [resize_nearest(view.depth, *camera.shape) for view, camera in zip(trusted, cameras, strict=True)]
    box, _ = find_box(images, cameras, find_segments(images, cameras), known)
    found = []
    for view in trusted:
        depth, sigma = _of_box(box, view.camera)
        found.append(AlignedDepth(depth, sigma, view.camera))
    return tuple(found)


def with_layout(
    estimates: Sequence[AlignedDepth],
    carried: np.ndarray,
    captures: Sequence[Capture],
    trusted: Sequence[KnownDepth],
    progress: Progress = SILENT,
) -> tuple[AlignedDepth, ...]:
    """``estimates``, and the layout's in place of those that say nothing of captures that are ``carried`` (N,) bool."""
    lacking = carried & np.array([not one.depth.any() for one in estimates])
    if not lacking.any():
        return tuple(estimates)
    told = layout_depth(captures, trusted, progress)
    names = ", ".join(captures[index].name for index in np.flatnonzero(lacking))
    progress.message(f"the depth of {names} is estimated by the room's layout", level="warning")
    return tuple(b if lacks else a for a, b, lacks in zip(estimates, told, lacking, strict=True))


def _of_box(box: RoomBox, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) float32 planar depth of the box and its relative sigma."""
    depth, side = box.hit(camera)
    off = box.sides - np.repeat(box.axes @ camera.centre, 2)
    sigma = np.hypot(box.sigma / np.maximum(np.abs(off), 0.1), _LEAST_SIGMA)[side]
    return depth.astype(np.float32), sigma.astype(np.float32)
