"""Given poses that are a little wrong, adjusted to what the captures see in common.

A third of a degree is two pixels: enough to take dense stereo off its epipolar lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..config.settings import CaptureSettings
from ..core.cameras import Camera, rotation_angle_rad
from ..core.errors import NoOverlapError
from ..core.progress import SILENT, Progress
from .given_judgement import check_unit, judged
from .importing import Imported
from .matching.overlap import Pairs, confirming, match_all, match_guided, near_pairs
from .solving.bundle_adjustment import adjusted, reprojection_errors
from .sparse import USUAL_DEPTH_M, Detected, beside_xfeat, detect, triangulate_matches, usual_depth
from .sparse_points import SparsePoints

# Matches are looked for this many standard deviations off the given epipolar lines.
_BAND_SIGMAS = 2.0
# Share of the median reprojection error that the refined poses may leave of the given ones':
# where the given poses were right their own freedom takes a tenth of it.
_CLEARLY_LOWER = 0.75
# Share of the given poses' standard deviations that those have which stay where they are.
_FIXED = 1e-3


def triangulate_refined(
    imported: Imported, settings: CaptureSettings, progress: Progress = SILENT
) -> tuple[Imported, SparsePoints]:
    """What the captures see in common, triangulated, and the captures at their refined poses.

    Captures with given poses that share nothing are as they are, with no points and a warning.

    With ``refine_poses`` as "auto" the given poses are kept unless the median reprojection
    error falls below three quarters of theirs; poses that were solved here are always
    kept, and so are those of captures with too few tracks, with a warning. The frame and the
    scale of the given poses are kept (``bundle_adjustment.adjusted``). ``changes`` say what
    was done. Before that lenses and single photographs are judged (``given_judgement.judged``).
    Raises CaptureError as that and ``sparse.triangulate`` do.
    """
    try:
        return _triangulated(imported, settings, progress)
    except NoOverlapError as nothing:
        if imported.solved:
            raise
        progress.message(f"{nothing.what}: how far away things are has to be estimated", level="warning")
        return imported, SparsePoints.none(len(imported.captures))


def _triangulated(imported: Imported, settings: CaptureSettings, progress: Progress) -> tuple[Imported, SparsePoints]:
    detected, plain = _matched(imported, settings, progress)
    for lenses_too in () if imported.solved else (True, False):
        off_px = band_px([capture.camera for capture in imported.captures], settings)
        given, imported = imported, judged(imported, detected, plain, off_px, settings, progress, lenses_too)
        if imported is given:
            break
        detected, plain = _matched(imported, settings, progress)
    captures = imported.captures
    names = [capture.name for capture in captures]
    # Its mistakes agree with each other where a room repeats itself: no pose is judged by XFeat.
    detected, wider = beside_xfeat(detected, plain, [capture.camera for capture in captures], settings, progress)
    cameras: Sequence[Camera] = [capture.camera for capture in captures]
    if settings.refine_poses != "never" and not imported.solved:
        cameras, told = _refined(imported, detected, wider, settings, progress)
        if told:
            progress.message(told)
            imported = imported.changed([replace(c, camera=at) for c, at in zip(captures, cameras, strict=True)], told)
    confirmed = confirming(wider, detected.features, cameras, settings.max_error_px, settings)
    pairs = match_guided(confirmed, detected.features, cameras, names, settings, progress, plain)
    sparse = triangulate_matches(cameras, detected, pairs, settings.max_error_px, settings, progress)
    check_unit(imported, sparse, progress)
    return imported, sparse


def _matched(imported: Imported, settings: CaptureSettings, progress: Progress) -> tuple[Detected, Pairs]:
    """The captures' features, and their matches whatever the poses."""
    detected = detect(imported.captures, settings, progress)
    near = near_pairs([capture.camera for capture in imported.captures])
    return detected, match_all(detected.features, settings, progress, among=near)


def _refined(
    imported: Imported, detected: Detected, plain: Pairs, settings: CaptureSettings, progress: Progress
) -> tuple[Sequence[Camera], str]:
    """The cameras and what was done to them in words, which are none when nothing was."""
    given = [capture.camera for capture in imported.captures]
    sparse = tracks_near(given, detected, plain, settings, progress)
    tracks = len(sparse.points)
    if tracks < settings.min_matches * (len(given) - 1):
        progress.message(
            f"the given poses are kept as they are: {tracks} tracks are too few to refine those of "
            f"{len(given)} captures",
            level="warning",
        )
        return given, ""
    unit_m = 1.0 if imported.metric else USUAL_DEPTH_M / usual_depth(imported.captures, sparse)
    adjustment = Adjustment.of(given, sparse, settings, unit_m)
    if settings.refine_poses == "auto" and not adjustment.clearly_better:
        progress.message(
            f"the given poses are kept: {tracks} tracks agree with them to {adjustment.before_px:.2f} px, and to "
            f"{adjustment.after_px:.2f} px with refined ones"
        )
        return given, ""
    return adjustment.cameras, adjustment.told()


def tracks_near(
    given: Sequence[Camera], detected: Detected, matches: Pairs, settings: CaptureSettings, progress: Progress
) -> SparsePoints:
    """The tracks of ``matches`` that poses as uncertain as given ones do not rule out, triangulated with these.

    Raises NoOverlapError where there are none.
    """
    off_px = band_px(given, settings)
    pairs = confirming(matches, detected.features, given, off_px, settings)
    return triangulate_matches(given, detected, pairs, off_px, settings, progress)


@dataclass(frozen=True, eq=False)
class Adjustment:
    """Given cameras, the same at the poses that their tracks and given poses fit best, and what that changed.

    Of those that may move alone: ``tracks`` is how many they measured, ``before_px`` and ``after_px`` are the median
    reprojection errors, NaN where they measured none. ``unit_m`` is the poses' unit of length.
    """

    given: Sequence[Camera]
    cameras: Sequence[Camera]
    unit_m: float
    tracks: int
    before_px: float
    after_px: float

    @staticmethod
    def of(
        cameras: Sequence[Camera], sparse: SparsePoints, settings: CaptureSettings, unit_m: float = 1.0, fixed: int = 0
    ) -> Adjustment:
        """Of ``cameras`` whose tracks are ``sparse``; the first ``fixed`` stay where they are."""
        free = np.where(np.arange(len(cameras)) < fixed, _FIXED, 1.0)
        sigmas = settings.pose_sigma_m / unit_m * free, np.radians(settings.pose_sigma_deg) * free
        found, points = adjusted(cameras, sparse.points, sparse.pixels, *sigmas)
        given, better, pixels = cameras[fixed:], found[fixed:], sparse.pixels[:, fixed:]
        tracks = int(np.isfinite(pixels[..., 0]).any(axis=1).sum())
        before_px, after_px = (
            float(np.median(reprojection_errors(at, where, pixels))) if tracks else np.nan
            for at, where in ((given, sparse.points), (better, points))
        )
        return Adjustment(given, better, unit_m, tracks, before_px, after_px)

    @property
    def clearly_better(self) -> bool:
        """Whether the median reprojection error fell by more than right poses' own freedom takes of it."""
        return self.after_px <= _CLEARLY_LOWER * self.before_px

    def told(self) -> str:
        """What was done to the poses, in words."""
        moved_cm = 100.0 * self.unit_m * np.linalg.norm(_centres(self.cameras) - _centres(self.given), axis=1)
        turned_deg = [
            np.degrees(rotation_angle_rad(a.world_from_camera, b.world_from_camera))
            for a, b in zip(self.given, self.cameras, strict=True)
        ]
        return (
            f"poses refined from {self.tracks} tracks: moved by {moved_cm.mean():.1f} cm and "
            f"{np.mean(turned_deg):.2f} deg, at most {moved_cm.max():.1f} and {max(turned_deg):.2f}; "
            f"reprojection {self.before_px:.2f} -> {self.after_px:.2f} px"
        )


def band_px(cameras: Sequence[Camera], settings: CaptureSettings) -> float:
    """How far off their epipolar lines matches are looked for: given poses put them there."""
    rad = np.hypot(np.radians(settings.pose_sigma_deg), settings.pose_sigma_m / USUAL_DEPTH_M)
    deviation_px = float(np.sqrt(2.0) * rad * max(max(camera.fx, camera.fy) for camera in cameras))
    return settings.max_error_px + _BAND_SIGMAS * deviation_px


def _centres(cameras: Sequence[Camera]) -> np.ndarray:
    return np.array([camera.centre for camera in cameras])
