"""The reference capture i(v) of a view: the one that sees most of what the view sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..config.settings import SelectionSettings
from ..core.cameras import Camera
from ..core.errors import GenerationError
from ..geometry.visibility.point_visibility import PROXY_ROUGHNESS_M
from .selection import Selection


def with_references(
    selection: Selection,
    candidates: Sequence[Camera],
    captures: Sequence[Camera],
    depth_of: Callable[[Camera], np.ndarray],
    settings: SelectionSettings,
    count: int,
) -> Selection:
    """The selection with the references of its ``count`` best candidates (line 9 of Algorithm 1).

    ``candidates`` are the M cameras it was made from; ``depth_of`` renders the proxy's planar
    depth (H, W), metres, 0 where there is none. Raises GenerationError without captures.
    """
    depths = [depth_of(camera.scaled(settings.overlap_scale)) for camera in captures]
    reference = selection.reference.copy()
    overlaps = np.zeros((len(reference), len(captures)))
    for index in selection.ranked[:count]:
        reference[index], overlaps[index] = select_reference(candidates[index], captures, depth_of, depths, settings)
    return replace(selection, reference=reference, overlaps=overlaps)


def select_reference(
    target: Camera,
    captures: Sequence[Camera],
    depth_of: Callable[[Camera], np.ndarray],
    capture_depths: Sequence[np.ndarray],
    settings: SelectionSettings,
) -> tuple[int, np.ndarray]:
    """The target's reference capture i(v) and each capture's overlap (N,) in [0, 1].

    The overlap is the share of the proxy points visible at the target (one a pixel of
    ``depth_of`` at the overlap scale) that are also visible in the capture: inside its
    image and not occluded, tested against the proxy's depth there, ``capture_depths``
    (each (H, W) float32 m, at any resolution of the capture's view). The first of equals
    is taken. Raises GenerationError when there are no captures.
    """
    if not captures:
        raise GenerationError("there are no captures to refer to", cure="Import the photographs again.")
    small = target.scaled(settings.overlap_scale)
    depth = depth_of(small)
    points = small.unproject(depth)[depth > 0.0]
    overlaps = np.zeros(len(captures))
    if len(points):
        for index, (camera, capture_depth) in enumerate(zip(captures, capture_depths, strict=True)):
            overlaps[index] = visible(points, camera, capture_depth, settings.overlap_tolerance).mean()
    return int(np.argmax(overlaps)), overlaps


def visible(points: np.ndarray, camera: Camera, depth: np.ndarray, tolerance: float) -> np.ndarray:
    """(P,) bool: the world points (P, 3) that ``camera``, with its depth map, sees."""
    pixels, z = camera.project(points)
    found = camera.sees(pixels, z)
    height, width = depth.shape
    columns = (pixels[found, 0] * (width / camera.width)).astype(np.int64)
    rows = (pixels[found, 1] * (height / camera.height)).astype(np.int64)
    seen = depth[np.minimum(rows, height - 1), np.minimum(columns, width - 1)]
    z = z[found]
    found[found] = (seen > 0.0) & (z <= seen * (1.0 + tolerance) + PROXY_ROUGHNESS_M)
    return found
