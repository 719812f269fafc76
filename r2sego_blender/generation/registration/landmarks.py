"""What frames are registered to: patches of the captures, placed by the captures' depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...captures.capture import Capture
from ...core.cameras import Camera
from ...core.errors import GenerationError
from ...core.progress import SILENT, Progress
from .capture_surfaces import CaptureSurface, MovedCapture
from .patch_matching import PatchMatches, corners, match_patches

_GLANCE_SIDE_PX = 80  # enough to tell how much of a view a capture shows
_PATCH_EVERY_PX = 24  # one corner a cell of this size


@dataclass(frozen=True)
class FoundLandmarks:
    """Landmarks found in a frame.

    ``pixels`` (m, 2) float64 in the frame; ``points`` (m, 3) world, metres; ``spreads``
    (m, 3) metres, one standard deviation of each point along its capture's ray;
    ``expected`` counts those that were looked for.
    """

    pixels: np.ndarray
    points: np.ndarray
    spreads: np.ndarray
    expected: int


@dataclass(frozen=True)
class Landmarks:
    """The captures as surfaces, whose patches are the landmarks of a frame."""

    surfaces: tuple[CaptureSurface, ...]

    @staticmethod
    def build(
        captures: Sequence[Capture],
        observed_depths: Sequence[np.ndarray],
        completed_depths: Sequence[np.ndarray] | None = None,
        progress: Progress = SILENT,
    ) -> Landmarks:
        """The captures on their depths (H, W), planar metres, 0 = unknown.

        ``completed_depths`` are taken, as less certain, where the observed are unknown.
        Raises GenerationError when no capture has any depth.
        """
        completed = completed_depths or list[np.ndarray | None]([None] * len(captures))
        maps = [*observed_depths, *(depth for depth in completed if depth is not None)]
        shapes = [one.camera.shape for one in captures] * (1 if completed_depths is None else 2)
        if [depth.shape for depth in maps] != shapes:
            raise ValueError("each capture needs depth maps of its camera's size")
        surfaces = []
        with progress.task("Placing the captures' patches", len(captures)) as task:
            for one, observed, filled in zip(captures, observed_depths, completed, strict=True):
                surfaces.append(CaptureSurface(one, observed, filled))
                task.advance()
        if not any(surface.face_count for surface in surfaces):
            raise GenerationError(
                "no capture has any reliable depth",
                cure="Check the captures' depth maps, or photograph the room with more texture in view.",
            )
        return Landmarks(tuple(surfaces))

    def seen_best(self, query: Camera, reference: Camera, count: int) -> list[CaptureSurface]:
        """The ``reference`` capture, then those that fill most of the query's image, ``count`` in all."""
        return [self.surfaces[i] for i in self.indices_seen_best(query, reference, count)]

    def indices_seen_best(self, query: Camera, reference: Camera, count: int) -> list[int]:
        """The captures of ``seen_best``, by their number."""
        glance = query.fitted(_GLANCE_SIDE_PX)
        is_reference = [
            np.array_equal(one.camera.world_from_camera, reference.world_from_camera) for one in self.surfaces
        ]
        filled = np.array([(one.seen_from(glance).depth > 0.0).mean() for one in self.surfaces])
        order = np.lexsort([-filled, np.logical_not(is_reference)])[:count]
        return [int(i) for i in order if filled[i] > 0.0]


def find_landmarks(
    grey: np.ndarray,
    camera: Camera,
    surfaces: Sequence[CaptureSurface],
    side_px: int,
    reach_px: float,
    min_correlation: float,
    match_ratio: float,
) -> FoundLandmarks:
    """Look for the surfaces' patches in a frame that ``camera`` is thought to have taken.

    ``grey`` (H, W) float32 in [0, 1] is compared at ``side_px`` pixels its longer side, or
    as it is when smaller, within ``reach_px`` of where the camera would see a patch. Each
    capture is compared by itself: where two agree, the frame's own errors cancel.
    """
    small = camera.fitted(side_px)
    image = cv2.resize(grey, (small.width, small.height), interpolation=cv2.INTER_AREA)
    reach = max(2, round(reach_px * small.width / camera.width))

    def match(moved: MovedCapture, columns: np.ndarray, rows: np.ndarray) -> PatchMatches:
        return match_patches(moved.grey, columns, rows, image, reach, min_correlation, match_ratio)

    return _found(camera, small, surfaces, match)


def landmarks_to_be_seen(camera: Camera, surfaces: Sequence[CaptureSurface], side_px: int) -> FoundLandmarks:
    """The surfaces' patches where ``camera`` would see them: those that are looked for, all found."""

    def place(moved: MovedCapture, columns: np.ndarray, rows: np.ndarray) -> PatchMatches:
        return PatchMatches(columns, rows, np.stack([columns, rows], axis=1) + 0.5, np.ones(len(columns)))

    return _found(camera, camera.fitted(side_px), surfaces, place)


def _found(
    camera: Camera,
    small: Camera,
    surfaces: Sequence[CaptureSurface],
    match: Callable[[MovedCapture, np.ndarray, np.ndarray], PatchMatches],
) -> FoundLandmarks:
    scale = np.array([camera.width / small.width, camera.height / small.height])
    pixels, points, spreads, expected = [np.empty((0, 2))], [np.empty((0, 3))], [np.empty((0, 3))], 0
    for surface in surfaces:
        moved = surface.seen_from(small)
        columns, rows = corners(moved.grey, moved.depth > 0.0, _PATCH_EVERY_PX)
        found = match(moved, columns, rows)
        placed, spread = surface.lift(moved, small, found.columns, found.rows)
        pixels.append(found.places * scale)
        points.append(placed)
        spreads.append(spread)
        expected += len(columns)
    return FoundLandmarks(np.concatenate(pixels), np.concatenate(points), np.concatenate(spreads), expected)
