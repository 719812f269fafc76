"""Where a generated frame really is: its pose and focal length, from the captures' patches.

The captures' photographs, moved to the query camera by their own depth, differ from the
frame by the frame's own drift. Their patches are found in it, first coarsely and as far off
as the gates allow, then finely about the pose that came of it (LO-RANSAC), and pose and
focal length are refined. All is solved relative to the fixed reference capture, whose
registered world pose it is composed with (Sec. 3.3). The query pose never becomes the
training pose and is no prior: it only says where to look, unless a registrar (``slot``)
says it, and bounds how far off a frame may be before it is rejected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...captures.solving.pnp import estimate_pose
from ...captures.solving.pose_refinement import RefinedPose, refine_pose
from ...config.settings import RegistrationSettings
from ...core.cameras import Camera, rotation_angle_rad
from ...core.formatting import share, share_apart, told_apart
from .capture_surfaces import CaptureSurface
from .landmarks import FoundLandmarks, Landmarks, find_landmarks, landmarks_to_be_seen

_COARSE_SIDE_PX, _FINE_SIDE_PX = 320, 640
_COARSE_INLIERS = 8  # fewer are found in any frame by chance
# Coarsely, patches are unmistakable. Where few of those to be seen are, texture repeats, and a
# pose off by one repetition would be confirmed finely. Frames that are placed rightly reach 0.3.
_COARSE_AGREEMENT = 0.15
_COARSE_ERROR = 2.0  # of the fine one: the coarse pose only has to bring patches within reach
_FINE_REACH = 2.5  # of the largest error
_FINE_CORRELATION = 0.7
_FINE_RATIO = 0.95  # in a small reach even repeated texture has one place
_FINE_PASSES = 4
_SETTLED = 0.5  # of the fine reach: what moved less was found where it belongs
_SPREAD_CELLS = (3, 4)  # rows, columns
_HOPELESS = 2.0  # of a limit: what misses it by less is tried, and a person may accept it
_ERROR_CELLS = 8  # to a row: matches nearer than that share their surface's error


@dataclass(frozen=True)
class RegisteredFrame:
    """The outcome of registering one frame.

    ``camera`` is the estimate that may be trained on, with the frame's own focal length,
    None when the frame is rejected; ``estimate`` is what was estimated in either case, None
    when nothing was. ``expected`` counts the patches to be seen, ``matches`` those found,
    ``inliers`` those that agree with the estimate; ``spread`` is the share of the image's
    4 x 3 cells that hold inliers; ``sigma_m`` and ``sigma_deg`` are the estimate's standard
    deviations; ``offset_m`` and ``turn_deg`` lead from the query to the estimate;
    ``focal_px`` is its focal length. ``reason`` says in words why it is accepted or rejected.
    """

    camera: Camera | None
    estimate: Camera | None
    expected: int
    matches: int
    inliers: int
    spread: float
    sigma_m: float
    sigma_deg: float
    offset_m: float
    turn_deg: float
    focal_px: float
    reason: str


def register_frame(
    image: np.ndarray,
    query: Camera,
    reference: Camera,
    landmarks: Landmarks,
    settings: RegistrationSettings,
    seed: int = 0,
    start: Camera | None = None,
) -> RegisteredFrame:
    """Estimate the pose of a generated frame (H, W, 3) float32 made for the ``query`` camera.

    The pose is solved in the frame of the fixed ``reference`` capture and composed with its
    world pose. The pose of ``start``, the query where there is none, and the query's lens say where
    the captures' patches are looked for; how far off the query the frame is counts in either case.
    The same seed gives the same bits.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(image[..., :3], np.float32), cv2.COLOR_RGB2GRAY)
    about = query if start is None else query.at(start.world_from_camera)
    surfaces = landmarks.seen_best(about, reference, settings.max_captures)
    found = find_landmarks(
        grey,
        about,
        surfaces,
        _COARSE_SIDE_PX,
        settings.search_radius_px,
        settings.min_correlation,
        settings.match_ratio,
    )
    coarse = _coarse_pose(found, query, reference, settings, seed)
    if coarse is None:
        return _nothing(found, f"no pose fits the {len(found.pixels)} of {found.expected} patches found")
    strayed = _strayed(coarse, query, settings, 2.0)
    if strayed:
        return _nothing(found, f"{len(found.pixels)} of {found.expected} patches found, {strayed}")
    found, refined = _fine_pose(grey, coarse, reference, surfaces, settings)
    if refined is None:
        return _nothing(found, f"no pose fits the {len(found.pixels)} of {found.expected} patches found")
    return _judged(found, refined, query, settings)


def hopeless(query: Camera, reference: Camera, landmarks: Landmarks, settings: RegistrationSettings) -> str:
    """Why no frame made for the ``query`` can be registered, however good it is; "" when one may be.

    All the captures' patches to be seen are taken as found where they belong: hardly any frame's
    pose is more certain. The arguments are those of ``register_frame``.
    """
    surfaces = landmarks.seen_best(query, reference, settings.max_captures)
    there = landmarks_to_be_seen(query, surfaces, _FINE_SIDE_PX)
    seen, needed = there.expected, settings.min_inliers
    if _HOPELESS * seen < needed:
        return f"only {seen} of the captures' patches would be seen, {needed} are needed"
    refined = _refined(there, query, query.fx, reference, settings)
    if refined is None:
        return "what would be seen of the captures determines no pose"
    uncertain = _uncertain(refined, settings, "would be", _HOPELESS)
    return uncertain and f"at best {uncertain}"


def _coarse_pose(
    found: FoundLandmarks, query: Camera, reference: Camera, settings: RegistrationSettings, seed: int
) -> Camera | None:
    points = _transformed(reference.camera_from_world, found.points)
    pose = estimate_pose(found.pixels, points, query, _COARSE_ERROR * settings.max_error_px, seed)
    if pose is None or pose.inlier_count < max(_COARSE_INLIERS, _COARSE_AGREEMENT * found.expected):
        return None
    return composed(reference, pose.camera)


def _fine_pose(
    grey: np.ndarray,
    start: Camera,
    reference: Camera,
    surfaces: Sequence[CaptureSurface],
    settings: RegistrationSettings,
) -> tuple[FoundLandmarks, RefinedPose | None]:
    """Find and refine until patches are found about where the pose has them."""
    reach_px = _FINE_REACH * settings.max_error_px
    camera = start
    for _ in range(_FINE_PASSES):
        found = find_landmarks(grey, camera, surfaces, _FINE_SIDE_PX, reach_px, _FINE_CORRELATION, _FINE_RATIO)
        refined = _refined(found, camera, start.fx, reference, settings)
        if refined is None:
            return found, None
        before, after = camera.project(found.points)[0], refined.camera.project(found.points)[0]
        camera = refined.camera
        if np.median(np.abs(after - before).max(axis=1)) < _SETTLED * reach_px:
            break
    return found, refined


def _refined(
    found: FoundLandmarks, camera: Camera, focal_px: float, reference: Camera, settings: RegistrationSettings
) -> RefinedPose | None:
    local = camera.at(reference.camera_from_world @ camera.world_from_camera)
    points = _transformed(reference.camera_from_world, found.points)
    spreads = found.spreads @ reference.world_from_camera[:3, :3]
    sigma_px = max(camera.width, camera.height) / _FINE_SIDE_PX
    refined = refine_pose(
        local,
        found.pixels,
        points,
        spreads,
        max(1.0, sigma_px),
        settings.max_error_px,
        focal_px,
        settings.focal_sigma,
        camera.width / _ERROR_CELLS,
    )
    return refined and replace(refined, camera=composed(reference, refined.camera))


def _judged(
    found: FoundLandmarks, refined: RefinedPose, query: Camera, settings: RegistrationSettings
) -> RegisteredFrame:
    """The gate: the estimate is accepted, or rejected with the first reason."""
    estimate = refined.camera
    inliers = int(refined.inliers.sum())
    spread = _spread(found.pixels[refined.inliers], query)
    agreement = inliers / max(1, found.expected)
    said = f"{inliers} of {found.expected} patches agree"
    failed = ""
    if inliers < settings.min_inliers:
        failed = f"{said}, {settings.min_inliers} are needed"
    elif agreement < settings.min_agreement:
        failed = f"{said}, {share(settings.min_agreement)} are needed"
    elif spread < settings.min_spread:
        covered = share_apart(spread, settings.min_spread)
        failed = f"the patches cover {covered} of the image, {share(settings.min_spread)} are needed"
    elif uncertain := _uncertain(refined, settings, "is"):
        failed = uncertain
    elif abs(estimate.fx / query.fx - 1.0) > settings.max_focal_error:
        found_px = told_apart(estimate.fx, round(query.fx), 0)
        failed = f"its focal length is {found_px} px instead of {query.fx:.0f}"
    else:
        failed = _strayed(estimate, query, settings)
    return RegisteredFrame(
        camera=None if failed else estimate,
        estimate=estimate,
        expected=found.expected,
        matches=len(found.pixels),
        inliers=inliers,
        spread=spread,
        sigma_m=refined.sigma_m,
        sigma_deg=refined.sigma_deg,
        offset_m=_offset_m(estimate, query),
        turn_deg=_turn_deg(estimate, query),
        focal_px=estimate.fx,
        reason=f"rejected: {failed}" if failed else f"registered: {said}",
    )


def _nothing(found: FoundLandmarks, failed: str) -> RegisteredFrame:
    return RegisteredFrame(
        camera=None,
        estimate=None,
        expected=found.expected,
        matches=len(found.pixels),
        inliers=0,
        spread=0.0,
        sigma_m=np.inf,
        sigma_deg=np.inf,
        offset_m=np.inf,
        turn_deg=np.inf,
        focal_px=np.nan,
        reason=f"rejected: {failed}",
    )


def _uncertain(refined: RefinedPose, settings: RegistrationSettings, verb: str, leeway: float = 1.0) -> str:
    """Why the pose is too uncertain, "" when it is not."""
    sigma_m, sigma_deg = refined.sigma_m, refined.sigma_deg
    if sigma_m > leeway * settings.max_sigma_m:
        told = told_apart(sigma_m, settings.max_sigma_m, 3)
        return f"its place {verb} uncertain by {told} m, {settings.max_sigma_m:g} are allowed"
    if sigma_deg > leeway * settings.max_sigma_deg:
        told = told_apart(sigma_deg, settings.max_sigma_deg, 1)
        return f"its turn {verb} uncertain by {told} deg, {settings.max_sigma_deg:g} are allowed"
    return ""


def _strayed(estimate: Camera, query: Camera, settings: RegistrationSettings, leeway: float = 1.0) -> str:
    """Why the estimate is too far from its query, "" when it is not."""
    offset_m, turn_deg = _offset_m(estimate, query), _turn_deg(estimate, query)
    if offset_m > leeway * settings.max_offset_m:
        told = told_apart(offset_m, settings.max_offset_m, 3)
        return f"it lies {told} m from its query, {settings.max_offset_m:g} m are allowed"
    if turn_deg > leeway * settings.max_turn_deg:
        told = told_apart(turn_deg, settings.max_turn_deg, 1)
        return f"it is turned {told} deg from its query, {settings.max_turn_deg:g} are allowed"
    return ""


def _offset_m(a: Camera, b: Camera) -> float:
    return float(np.linalg.norm(a.centre - b.centre))


def _turn_deg(a: Camera, b: Camera) -> float:
    return float(np.degrees(rotation_angle_rad(a.world_from_camera, b.world_from_camera)))


def composed(reference: Camera, relative: Camera) -> Camera:
    """A camera whose pose is in the frame of ``reference``, in the world: with the reference's fixed pose."""
    return relative.at(reference.world_from_camera @ relative.world_from_camera)


def _transformed(transform: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ transform[:3, :3].T + transform[:3, 3]


def _spread(pixels: np.ndarray, camera: Camera) -> float:
    rows, columns = _SPREAD_CELLS
    row = np.clip(pixels[:, 1] / camera.height * rows, 0, rows - 1).astype(np.int64)
    column = np.clip(pixels[:, 0] / camera.width * columns, 0, columns - 1).astype(np.int64)
    return len(np.unique(row * columns + column)) / (rows * columns)
