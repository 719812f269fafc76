"""Photographs without poses located among registered captures, for held-out views.

Features of the photograph are matched to those of the captures whose place in the world
is known, from sparse points and, where given, dense depth; the pose follows by PnP.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ...config.settings import CaptureSettings
from ...core.cameras import Camera
from ...core.errors import CaptureError
from ...core.images import image_files
from ...core.progress import SILENT, Progress
from ..capture import Capture
from ..matching.detection import sift_each
from ..matching.features import Features, match
from ..matching.xfeat import LEAST_EXPECTED, match_xfeat
from ..poses.photographs import upright_size
from ..poses.plain_folder import distinct_photographs, tell_copies
from ..sparse_points import SparsePoints
from .pnp import PoseEstimate, estimate_pose

# A feature belongs to a sparse point that was measured this near to it.
_SAME_FEATURE_PX = 1.0
_INLIER_ERROR_PX = 4.0
_ASPECT_TOLERANCE = 0.01


@dataclass(frozen=True)
class Landmarks:
    """Features of the captures whose place in the world is known.

    ``descriptors[i]`` (n_i, 128) uint8 and ``points[i]`` (n_i, 3) float64, world, belong to
    capture i.
    """

    descriptors: tuple[np.ndarray, ...]
    points: tuple[np.ndarray, ...]

    def matched(self, features: Features, ratio: float) -> tuple[np.ndarray, np.ndarray]:
        """Pixels (m, 2) of ``features`` and the world points (m, 3) they match."""
        pixels, points = [np.zeros((0, 2))], [np.zeros((0, 3))]
        for descriptors, places in zip(self.descriptors, self.points, strict=True):
            pairs = match(features.descriptors, descriptors, ratio)
            pixels.append(features.keypoints[pairs[:, 0]])
            points.append(places[pairs[:, 1]])
        return np.concatenate(pixels), np.concatenate(points)


def landmarks(
    captures: Sequence[Capture],
    sparse: SparsePoints,
    settings: CaptureSettings,
    depths: Sequence[np.ndarray] | None = None,
    progress: Progress = SILENT,
) -> Landmarks:
    """The landmarks of captures with their sparse points.

    ``depths`` are planar depth maps (h, w) in metres, 0 = unknown, of any scale, one for
    each capture; they place the features that no sparse point belongs to.
    """
    descriptors, points = [], []
    found = _features(captures, settings, progress, "Finding landmarks")
    for index, (capture, features) in enumerate(zip(captures, found, strict=True)):
        places = _places(features, capture, index, sparse, depths)
        known = np.isfinite(places).all(axis=1)
        descriptors.append(features.descriptors[known])
        points.append(places[known])
    return Landmarks(tuple(descriptors), tuple(points))


def locate_views(
    folder: Path,
    captures: Sequence[Capture],
    sparse: SparsePoints,
    settings: CaptureSettings,
    *,
    depths: Sequence[np.ndarray] | None = None,
    seed: int = 0,
    progress: Progress = SILENT,
) -> tuple[Capture, ...]:
    """The photographs in ``folder``, posed in the world frame of the captures.

    They must come from the captures' camera at the same zoom: its lens is used. A
    photograph that cannot be located, and a copy of one, is left out with a warning. Raises CaptureError when
    none can, or a photograph has another shape than every capture.
    """
    paths, copies = distinct_photographs(image_files(folder) if folder.is_dir() else [])
    if not paths:
        raise CaptureError("there are no photographs", where=folder, cure="Give a folder of photographs.")
    tell_copies(copies, progress)
    known = landmarks(captures, sparse, settings, depths, progress)
    views = [_unposed(path, captures) for path in paths]
    detected = _features(views, settings, progress, "Locating photographs: features")
    estimates = [
        locate(features, view.camera, known, settings, seed)
        for features, view in zip(detected, progress.track(views, "Locating photographs"), strict=True)
    ]
    missed = [index for index, estimate in enumerate(estimates) if estimate is None]
    if missed and settings.matcher == "xfeat":
        wider = _locate_by_xfeat([views[i] for i in missed], captures, sparse, settings, depths, seed, progress)
        for index, found in zip(missed, wider, strict=True):
            estimates[index] = found
    located = []
    for view, estimate in zip(views, estimates, strict=True):
        if estimate is None:
            progress.message(f"{view.name}: cannot be located among the captures", level="warning")
        else:
            located.append(replace(view, camera=estimate.camera))
    if not located:
        raise CaptureError(
            f"none of the {len(paths)} photographs can be located among the captures",
            where=folder,
            cure="Give photographs of the same room that overlap the captures, sharp and well lit.",
        )
    return tuple(located)


def _features(views: Sequence[Capture], settings: CaptureSettings, progress: Progress, title: str) -> list[Features]:
    return sift_each(lambda index: views[index].image(), len(views), settings.max_features, progress, title)


def locate(
    features: Features, camera: Camera, known: Landmarks, settings: CaptureSettings, seed: int
) -> PoseEstimate | None:
    """The pose of an undistorted image, by its ``features``, with ``camera``'s lens, or None."""
    return _posed(*known.matched(features, settings.match_ratio), camera, settings, seed)


def _posed(
    pixels: np.ndarray, points: np.ndarray, camera: Camera, settings: CaptureSettings, seed: int
) -> PoseEstimate | None:
    estimate = estimate_pose(pixels, points, camera, _INLIER_ERROR_PX, seed)
    if estimate is None or estimate.inlier_count < settings.min_matches:
        return None
    return estimate


def _locate_by_xfeat(
    views: Sequence[Capture],
    captures: Sequence[Capture],
    sparse: SparsePoints,
    settings: CaptureSettings,
    depths: Sequence[np.ndarray] | None,
    seed: int,
    progress: Progress,
) -> list[PoseEstimate | None]:
    """As ``locate``, of views that lie too far from the captures for SIFT."""
    count = len(captures)
    among = [(i, count + k) for k in range(len(views)) for i in range(count)]
    images = [capture.image() for capture in (*captures, *views)]
    found = match_xfeat(images, among, settings, progress, "Locating photographs from afar", LEAST_EXPECTED)
    if found is None:
        return [None] * len(views)
    places = [_places(found.features[i], one, i, sparse, depths) for i, one in enumerate(captures)]
    estimates = []
    for k, view in enumerate(views):
        pixels, points = [np.zeros((0, 2))], [np.zeros((0, 3))]
        for i in range(count):
            matches = found.pairs.get((i, count + k), np.zeros((0, 2), np.int32))
            known = matches[np.isfinite(places[i][matches[:, 0]]).all(axis=1)]
            pixels.append(found.features[count + k].keypoints[known[:, 1]])
            points.append(places[i][known[:, 0]])
        estimates.append(_posed(np.concatenate(pixels), np.concatenate(points), view.camera, settings, seed))
    return estimates


def _unposed(path: Path, captures: Sequence[Capture]) -> Capture:
    """The photograph as a capture at no pose, through the lens of the captures."""
    width, height = upright_size(path)
    for capture in captures:
        lens = capture.lens
        size = (lens.width, lens.height) if lens else (capture.camera.width, capture.camera.height)
        if abs(size[0] / size[1] / (width / height) - 1.0) > _ASPECT_TOLERANCE:
            continue
        longest = max(capture.camera.width, capture.camera.height)
        if lens is None:
            working = capture.camera.at(np.eye(4))
            return Capture(path.name, path, working)
        lens = lens.scaled_to(width, height)
        return Capture(path.name, path, lens.straight(np.eye(4)).fitted(longest), lens)
    raise CaptureError(
        f"the photograph is {width}x{height}, a shape that no capture has",
        where=path,
        cure="Take held-out photographs with the captures' camera, held the same way, without zoom.",
    )


def _places(
    features: Features, capture: Capture, index: int, sparse: SparsePoints, depths: Sequence[np.ndarray] | None
) -> np.ndarray:
    """(n, 3) world points of the features of capture ``index``, NaN where unknown."""
    places = _sparse_places(features, sparse, index)
    if depths is not None:
        unknown = np.isnan(places[:, 0])
        dense = _dense_places(features.keypoints, np.asarray(depths[index]), capture.camera)
        places[unknown] = dense[unknown]
    return places


def _sparse_places(features: Features, sparse: SparsePoints, index: int) -> np.ndarray:
    """(n, 3) world points of the features that are measurements of sparse points, else NaN."""
    places = np.full((len(features.keypoints), 3), np.nan)
    rows = np.flatnonzero(sparse.visibility[:, index])
    if len(rows) and len(places):
        distance, nearest = cKDTree(sparse.pixels[rows, index]).query(features.keypoints)
        same = distance <= _SAME_FEATURE_PX
        places[same] = sparse.points[rows[nearest[same]]]
    return places


def _dense_places(keypoints: np.ndarray, depth: np.ndarray, camera: Camera) -> np.ndarray:
    """(n, 3) world points of keypoints at the depth of their pixel, NaN where unknown."""
    height, width = depth.shape
    column = np.clip((keypoints[:, 0] * width / camera.width).astype(int), 0, width - 1)
    row = np.clip((keypoints[:, 1] * height / camera.height).astype(int), 0, height - 1)
    z = np.where(depth[row, column] > 0, depth[row, column].astype(np.float64), np.nan)
    x = (keypoints[:, 0] - camera.cx) / camera.fx * z
    y = (keypoints[:, 1] - camera.cy) / camera.fy * z
    return np.stack([x, y, z], axis=1) @ camera.world_from_camera[:3, :3].T + camera.centre
