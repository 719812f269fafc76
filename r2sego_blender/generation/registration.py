"""Where a generated frame really is: its pose and focal length, from its own features.

The captures' features, lifted by depth, are landmarks. A generated frame's features are
matched to them and its pose is solved relative to the fixed reference capture, whose
registered world pose it is composed with (Sec. 3.3). The query pose never becomes the
training pose: it only bounds how far off a frame may be before it is rejected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from ..cameras import Camera, rotation_angle_rad
from ..captures.capture import Capture
from ..captures.features import match_near, sift
from ..captures.pnp import PoseEstimate, estimate_pose
from ..errors import GenerationError
from ..progress import SILENT, Progress
from ..settings import RegistrationSettings

_SPREAD_CELLS = (3, 4)  # rows, columns
# A feature on a depth edge has no depth of its own: its four pixels must agree this well.
_EDGE_JUMP = 0.05


@dataclass(frozen=True)
class Landmarks:
    """The captures' features as points of the world.

    ``points`` (L, 3) float64 metres; ``descriptors`` (L, 128) uint8; ``capture`` (L,) int64,
    the capture each was seen in, rising.
    """

    points: np.ndarray
    descriptors: np.ndarray
    capture: np.ndarray

    @staticmethod
    def build(
        captures: Sequence[Capture],
        capture_depths: Sequence[np.ndarray],
        reliable: Sequence[np.ndarray] | None,
        settings: RegistrationSettings,
        progress: Progress = SILENT,
    ) -> Landmarks:
        """Lift every capture's SIFT features by its depth (H, W), metres, 0 = unknown.

        ``reliable``, when given, are (H, W) bool masks of the depths to trust. Features on
        depth edges or without depth are left out. Raises GenerationError when none is left.
        """
        if [depth.shape for depth in capture_depths] != [one.camera.shape for one in captures]:
            raise ValueError("each capture needs one depth map of its camera's size")
        points, descriptors, capture = [], [], []
        masks = [depth > 0.0 for depth in capture_depths] if reliable is None else reliable
        with progress.task("Lifting capture features", len(captures)) as task:
            for index, (one, depth, mask) in enumerate(zip(captures, capture_depths, masks, strict=True)):
                features = sift(one.image(), settings.max_features)
                z = _depth_at(features.keypoints, np.where(mask, depth, 0.0))
                lifted = z > 0.0
                points.append(_lift(one.camera, features.keypoints[lifted], z[lifted]))
                descriptors.append(features.descriptors[lifted])
                capture.append(np.full(int(lifted.sum()), index))
                task.advance()
        if not sum(map(len, points)):
            raise GenerationError(
                "no capture has features on reliable depth",
                cure="Check the captures' depth maps, or photograph the room with more texture in view.",
            )
        return Landmarks(np.concatenate(points), np.concatenate(descriptors), np.concatenate(capture))


@dataclass(frozen=True)
class RegisteredFrame:
    """The outcome of registering one frame.

    ``camera`` is the estimate that may be trained on, None when the frame is rejected;
    ``estimate`` is what was estimated in either case, None when nothing was. ``matches``
    and ``inliers`` count features; ``spread`` is the share of the image's 4 x 3 cells that
    hold inliers; ``offset_m`` and ``turn_deg`` lead from the query to the estimate;
    ``focal_px`` is the focal length that fits the inliers best. ``reason`` says in words
    why the frame is accepted or rejected.
    """

    camera: Camera | None
    estimate: Camera | None
    matches: int
    inliers: int
    spread: float
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
) -> RegisteredFrame:
    """Estimate the pose of a generated frame (H, W, 3) float32 made for the ``query`` camera.

    The pose is solved in the frame of the fixed ``reference`` capture and composed with its
    world pose. The query's lens is used; its pose says where landmarks are looked for,
    as far off as the gates allow, and never is the frame's pose.
    """
    pixels, points = _matches(image, query, landmarks, settings)
    reference_from_world = reference.camera_from_world
    local = points @ reference_from_world[:3, :3].T + reference_from_world[:3, 3]
    found = estimate_pose(pixels, local, query, settings.max_error_px, seed)
    if found is None:
        nothing = f"rejected: no pose fits the {len(pixels)} matches with the captures"
        return RegisteredFrame(None, None, len(pixels), 0, 0.0, np.inf, np.inf, np.nan, nothing)
    estimate = query.at(reference.world_from_camera @ found.camera.world_from_camera)
    inliers = found.inlier_count
    spread = _spread(pixels[found.inliers], query)
    offset_m = float(np.linalg.norm(estimate.centre - query.centre))
    turn_deg = float(np.degrees(rotation_angle_rad(estimate.world_from_camera, query.world_from_camera)))
    focal_px = _focal(found, pixels[found.inliers], local[found.inliers], settings.max_error_px)
    failed = ""
    if inliers < settings.min_inliers:
        failed = f"{inliers} of {len(pixels)} matches agree, {settings.min_inliers} are needed"
    elif spread < settings.min_spread:
        failed = f"the matches cover {spread:.0%} of the image, {settings.min_spread:.0%} are needed"
    elif offset_m > settings.max_offset_m:
        failed = f"it lies {offset_m:.3f} m from its query, {settings.max_offset_m:g} m are allowed"
    elif turn_deg > settings.max_turn_deg:
        failed = f"it is turned {turn_deg:.1f} deg from its query, {settings.max_turn_deg:g} are allowed"
    elif abs(focal_px / query.fx - 1.0) > settings.max_focal_error:
        failed = f"its focal length is {focal_px:.0f} px instead of {query.fx:.0f}"
    reason = f"rejected: {failed}" if failed else f"registered: {inliers} of {len(pixels)} matches agree"
    return RegisteredFrame(
        None if failed else estimate, estimate, len(pixels), inliers,
        spread, offset_m, turn_deg, focal_px, reason,
    )  # fmt: skip


def _matches(
    image: np.ndarray, query: Camera, landmarks: Landmarks, settings: RegistrationSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (m, 2) and landmark points (m, 3), matched with each capture by itself.

    Apart, because the same point in two captures would fail the ratio test against itself.
    Only landmarks that the query would see near a feature are compared with it: planks,
    tiles and book spines are all alike elsewhere.
    """
    features = sift(image, settings.max_features)
    places, depth = query.project(landmarks.points)
    places[~query.sees(places, depth, -settings.search_radius_px)] = np.nan
    pixels, points = [np.empty((0, 2))], [np.empty((0, 3))]
    for index in np.unique(landmarks.capture):
        members = np.flatnonzero(landmarks.capture == index)
        pairs = match_near(
            features, landmarks.descriptors[members], places[members],
            settings.search_radius_px, settings.match_ratio,
        )  # fmt: skip
        pixels.append(features.keypoints[pairs[:, 0]])
        points.append(landmarks.points[members[pairs[:, 1]]])
    return np.concatenate(pixels).astype(np.float64), np.concatenate(points)


def _depth_at(keypoints: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(n,) float64: depth bilinear in its inverse, exact on planes; 0 at edges and unknowns."""
    height, width = depth.shape
    place = keypoints.astype(np.float64) - 0.5
    column = np.clip(place[:, 0], 0.0, width - 1.001)
    row = np.clip(place[:, 1], 0.0, height - 1.001)
    c, r = column.astype(np.int64), row.astype(np.int64)
    corners = np.stack([depth[r, c], depth[r, c + 1], depth[r + 1, c], depth[r + 1, c + 1]]).astype(
        np.float64
    )
    a, b = column - c, row - r
    shares = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b])
    nearest, farthest = corners.min(axis=0), corners.max(axis=0)
    smooth = (nearest > 0.0) & (farthest - nearest < _EDGE_JUMP * farthest)
    z = np.zeros(len(keypoints))
    z[smooth] = 1.0 / np.sum(shares[:, smooth] / corners[:, smooth], axis=0)
    return z


def _lift(camera: Camera, pixels: np.ndarray, z: np.ndarray) -> np.ndarray:
    """(n, 3) float64 world points of pixels (n, 2) at planar depths (n,)."""
    x = (pixels[:, 0] - camera.cx) / camera.fx * z
    y = (pixels[:, 1] - camera.cy) / camera.fy * z
    return np.stack([x, y, z], axis=1) @ camera.world_from_camera[:3, :3].T + camera.centre


def _spread(pixels: np.ndarray, camera: Camera) -> float:
    rows, columns = _SPREAD_CELLS
    row = np.clip(pixels[:, 1] / camera.height * rows, 0, rows - 1).astype(np.int64)
    column = np.clip(pixels[:, 0] / camera.width * columns, 0, columns - 1).astype(np.int64)
    return len(np.unique(row * columns + column)) / (rows * columns)


def _focal(found: PoseEstimate, pixels: np.ndarray, points: np.ndarray, error_px: float) -> float:
    """The focal length (fx, px) that fits best together with the pose, from the pose found."""
    camera = found.camera
    start = camera.camera_from_world

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        turned = Rotation.from_rotvec(unknowns[:3]).as_matrix() @ start[:3, :3]
        local = points @ turned.T + start[:3, 3] + unknowns[3:6]
        scale = np.exp(unknowns[6]) / np.maximum(local[:, 2:], 1e-6)
        projected = local[:, :2] * scale * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        return (projected - pixels).ravel()

    solved = least_squares(residuals, np.zeros(7), loss="soft_l1", f_scale=error_px / 2.0, max_nfev=30)
    return float(camera.fx * np.exp(solved.x[6]))
