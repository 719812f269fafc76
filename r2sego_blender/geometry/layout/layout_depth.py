"""Depth of each capture from the room's layout alone: floor, walls and ceiling of a box, and what stands in it."""

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
from .furniture import Standing, find_standing
from .room_box import FLOOR, RoomBox
from .segments import Segments, find_segments, level_turn

_WORKING_PX = 320
_FEWEST_SEGMENTS = 5  # a capture
_LEAST_SHARE = 0.1  # of the segments' length, that follows two square directions
_USUAL_M, _USUAL_SIGMA_M = 2.0, 1.0  # from the outermost captures to a wall, where nothing tells
_USUAL_HEIGHT_M, _HEIGHT_SIGMA_M = 2.5, 0.3

# Relative, as made-up rooms tell (tests/geometry/layout).
_SIGMA, _FLOOR_SIGMA, _STRANGE_SIGMA = 0.05, 0.02, 0.3
_STANDING_SIGMA, _CUT_SIGMA = 0.2, 0.35


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
    segments = find_segments(images, cameras)
    box = _room(images, cameras, segments, known, progress)
    standing = find_standing(images, cameras, segments, box)
    return tuple(_with_standing(box, view.camera, one) for view, one in zip(trusted, standing, strict=True))


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


def _room(
    images: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    segments: Segments,
    known: Sequence[np.ndarray],
    progress: Progress,
) -> RoomBox:
    if len(segments.view) >= _FEWEST_SEGMENTS * len(cameras) and level_turn(segments)[1] >= _LEAST_SHARE:
        return find_box(images, cameras, segments, known)[0]
    progress.message("the photographs show no edges of a room: walls are taken to be where they usually are", "warning")
    centres = np.array([camera.centre for camera in cameras])
    low, high = centres.min(0) - _USUAL_M, centres.max(0) + _USUAL_M
    low[2], high[2] = 0.0, max(_USUAL_HEIGHT_M, float(centres[:, 2].max()) + _HEIGHT_SIGMA_M)
    sigma = np.array([_USUAL_SIGMA_M] * 4 + [0.0, _HEIGHT_SIGMA_M])
    return RoomBox(0.0, low, high, sigma, 0.0)


def _with_standing(box: RoomBox, camera: Camera, standing: Standing) -> AlignedDepth:
    """Planar depth of the box and of what stands before its walls, for each pixel of ``camera``."""
    depth, side = box.hit(camera)
    off = np.abs(box.sides - np.repeat(box.axes @ camera.centre, 2))
    sigma = np.hypot(box.sigma / np.maximum(off, 0.1), np.where(np.arange(6) == FLOOR, _FLOOR_SIGMA, _SIGMA))[side]
    before, odds = (resize_nearest(one, *camera.shape) for one in (standing.depth, standing.odds))
    cut = resize_nearest(standing.cut, *camera.shape)
    sigma = np.where((side == FLOOR) & (odds > 0.0), _STRANGE_SIGMA, sigma)
    stands = (before > 0.0) & (before < depth)
    sigma = np.where(stands, np.where(cut, _CUT_SIGMA, _STANDING_SIGMA), sigma)
    return AlignedDepth(np.where(stands, before, depth).astype(np.float32), sigma.astype(np.float32), camera)
