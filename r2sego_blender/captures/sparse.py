"""Sparse points: features of the posed captures matched and triangulated.

The first, sparse part of the paper's fragmentary geometry ``M_obs = (P_obs, A_obs)``
(Sec. "Capture-Anchored Geometry Proxy"): points, and which captures saw each.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..config.settings import CaptureSettings
from ..core.cameras import Camera
from ..core.errors import CaptureError, NoOverlapError
from ..core.progress import SILENT, Progress
from ..core.scratch import ScratchFolder
from ..workers.child import call_in_child
from .capture import Capture
from .colmap import load_pycolmap
from .matching.detection import sift_each
from .matching.features import Features
from .matching.overlap import (
    OVERLAP_CURE,
    Matched,
    Pairs,
    confirming,
    load_matches,
    match_all,
    match_guided,
    near_pairs,
    save_matches,
    write_database,
)
from .matching.xfeat import NAME, match_xfeat
from .sparse_points import SparsePoints

USUAL_DEPTH_M = 2.5
"""Distance from a camera to what it sees indoors, for tolerances before the scale is known."""

# Two captures that share so many matches of SIFT's need no others: SIFT's are three times as exact. Nor do
# those that each share as many with so many others: what they see is measured, and better by SIFT alone.
_PLENTY, _ENOUGH_OTHERS = 100, 2
# Times ``min_matches``: of fewer, the most may be chance.
_FEW_MATCHES = 3
# With a few wide views half of all true points are seen by two rays only a little apart.
_MIN_TRIANGULATION_ANGLE_DEG = 1.0
# Depth ranges: robust ends of the measured depths, and room for surfaces without features.
_RANGE_PERCENTILES = (1.0, 99.0)
_RANGE_MARGIN = (0.7, 1.5)
_RANGE_MIN_POINTS = 10
_USUAL_RANGE_M = (0.5, 8.0)
_TIMEOUT_S = 1200.0


class Detected(NamedTuple):
    """The features of captures, and the captures' images (H, W, 3) uint8."""

    features: list[Features]
    images: list[np.ndarray]


def detect(captures: Sequence[Capture], settings: CaptureSettings, progress: Progress = SILENT) -> Detected:
    """The SIFT features of captures."""
    images = [(capture.image() * 255.0 + 0.5).astype(np.uint8) for capture in captures]
    return Detected(sift_each(images.__getitem__, len(images), settings.max_features, progress), images)


def beside_xfeat(
    detected: Detected, plain: Pairs, cameras: Sequence[Camera], settings: CaptureSettings, progress: Progress = SILENT
) -> tuple[Detected, Pairs]:
    """The features and ``plain`` matches of SIFT, and XFeat's of near pairs that are ``poorly_matched``."""
    few = poorly_matched(plain, near_pairs(cameras), len(cameras))
    further = match_xfeat(detected.images, few, settings, progress) if few and settings.matcher == "xfeat" else None
    if further is None:
        return detected, plain
    progress.message(f"{NAME} match {len(further.pairs)} of the {len(few)} pairs that share few of SIFT's features")
    features, pairs = Matched(detected.features, plain).beside(further)
    return Detected(features, detected.images), pairs


def poorly_matched(plain: Pairs, near: Sequence[tuple[int, int]], count: int) -> list[tuple[int, int]]:
    """The pairs of ``near``, of so many captures, that share few matches, and of which one shares plenty with
    hardly any other."""
    plenty = [pair for pair, found in plain.items() if len(found) >= _PLENTY]
    others = [sum(index in pair for pair in plenty) for index in range(count)]
    return [
        pair
        for pair in near
        if len(plain.get(pair, ())) < _PLENTY and min(others[index] for index in pair) < _ENOUGH_OTHERS
    ]


def triangulate(captures: Sequence[Capture], settings: CaptureSettings, progress: Progress = SILENT) -> SparsePoints:
    """Triangulate what the posed captures see in common.

    Points are in the frame and unit of the captures' poses, which stay as they are.
    Raises CaptureError when no two captures overlap, or their poses contradict them.
    """
    detected = detect(captures, settings, progress)
    cameras = [capture.camera for capture in captures]
    names = [capture.name for capture in captures]
    plain = match_all(detected.features, settings, progress, among=near_pairs(cameras))
    detected, wider = beside_xfeat(detected, plain, cameras, settings, progress)
    confirmed = confirming(wider, detected.features, cameras, settings.max_error_px, settings)
    pairs = match_guided(confirmed, detected.features, cameras, names, settings, progress)
    return triangulate_matches(cameras, detected, pairs, settings.max_error_px, settings, progress)


def triangulate_matches(
    cameras: Sequence[Camera],
    detected: Detected,
    pairs: Pairs,
    max_error_px: float,
    settings: CaptureSettings,
    progress: Progress = SILENT,
) -> SparsePoints:
    """The points of matched features, each within ``max_error_px`` of its measurements.

    Raises CaptureError when there are fewer than ``min_matches``: NoOverlapError where hardly more was matched.
    """
    with progress.task("Triangulating", total=1) as task, ScratchFolder() as folder:
        save_matches(Path(folder, "matches.npz"), detected.features, pairs)
        request = {"folder": folder, "cameras": [camera.to_json() for camera in cameras], "max_error_px": max_error_px}
        call_in_child(triangulate_in_child, request, timeout_s=_TIMEOUT_S)
        with np.load(Path(folder, "points.npz"), allow_pickle=False) as data:
            points, error_px, pixels = data["points"], data["error_px"], data["pixels"]
        task.advance()
    if len(points) < settings.min_matches:
        if sum(map(len, pairs.values())) < _FEW_MATCHES * settings.min_matches:
            raise NoOverlapError(
                f"the captures share {len(points)} points, too few to measure anything by",
                where="captures",
                cure=OVERLAP_CURE,
            )
        raise CaptureError(
            f"the captures overlap, but only {len(points)} points lie in front of their cameras",
            where="camera poses",
            cure="Check the poses' axis convention (docs/formats.md), and photograph from places at "
            "least a step apart: turning on the spot measures nothing.",
        )
    visibility = np.isfinite(pixels[..., 0])
    colours = _colours(detected.images, pixels, visibility)
    return SparsePoints(points, colours, visibility, error_px, pixels)


def triangulate_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """The part of ``triangulate`` that runs in a child process; writes ``points.npz``."""
    pycolmap = load_pycolmap()
    os.chdir(request["folder"])  # Windows' COLMAP opens no database by a path of letters beyond the system's
    folder = Path()
    cameras = [Camera.from_json(camera) for camera in request["cameras"]]
    features, pairs = load_matches(folder / "matches.npz")
    lenses = [
        pycolmap.Camera(model="PINHOLE", width=c.width, height=c.height, params=[c.fx, c.fy, c.cx, c.cy])
        for c in cameras
    ]
    database = folder / "database.db"
    names = [f"{index:06d}" for index in range(len(cameras))]
    ids = write_database(database, lenses, range(len(cameras)), names, features, pairs, verified=True)
    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as opened:
        for image_id, camera in zip(ids, cameras, strict=True):
            image = opened.read_image(image_id)
            model.add_camera_with_trivial_rig(opened.read_camera(image.camera_id))
            pose = camera.camera_from_world
            image = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image_id)
            model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:3, :3]), pose[:3, 3]))
    pycolmap.set_random_seed(0)
    options = pycolmap.IncrementalPipelineOptions(num_threads=1, random_seed=0, extract_colors=False, min_num_matches=1)
    options.mapper.filter_max_reproj_error = float(request["max_error_px"])
    options.mapper.filter_min_tri_angle = _MIN_TRIANGULATION_ANGLE_DEG
    options.triangulation.min_angle = _MIN_TRIANGULATION_ANGLE_DEG
    # COLMAP drops tracks of two views by default: with six captures those are most points.
    options.triangulation.ignore_two_view_tracks = False
    (folder / "model").mkdir()
    solved = pycolmap.triangulate_points(model, database, folder, folder / "model", True, options)
    column = {image_id: index for index, image_id in enumerate(ids)}
    points, error_px, pixels = _points_of(solved, features, column)
    np.savez(folder / "points.npz", points=points, error_px=error_px, pixels=pixels)
    return {"points": len(points)}


def _points_of(model: Any, features: Sequence[Features], column: dict[int, int]) -> tuple[np.ndarray, ...]:
    """Points (P, 3), mean errors (P,) and pixels (P, N, 2) of a model, in the order of their ids."""
    tracks = [(model.points3D[key].xyz, model.points3D[key]) for key in sorted(model.points3D.keys())]
    points = np.array([xyz for xyz, _ in tracks], np.float64).reshape(-1, 3)
    error_px = np.array([point.error for _, point in tracks], np.float64)
    pixels = np.full((len(tracks), len(column), 2), np.nan, np.float32)
    for row, (_, point) in enumerate(tracks):
        for element in point.track.elements:
            index = column[element.image_id]
            pixels[row, index] = features[index].keypoints[element.point2D_idx]
    return points, error_px, pixels


def _colours(images: Sequence[np.ndarray], pixels: np.ndarray, visibility: np.ndarray) -> np.ndarray:
    """(P, 3) uint8: the mean colour at a point's measurements."""
    total = np.zeros((len(pixels), 3))
    for index, image in enumerate(images):
        rows = visibility[:, index]
        column, line = np.floor(pixels[rows, index]).astype(int).T
        height, width = image.shape[:2]
        total[rows] += image[np.clip(line, 0, height - 1), np.clip(column, 0, width - 1)]
    return np.rint(total / visibility.sum(axis=1, keepdims=True)).astype(np.uint8)


def usual_depth(captures: Sequence[Capture], sparse: SparsePoints) -> float:
    """The median distance, in units of the poses, from captures to what they measured."""
    distances = [
        np.linalg.norm(sparse.points[sparse.visibility[:, index]] - capture.camera.centre, axis=1)
        for index, capture in enumerate(captures)
    ]
    together = np.concatenate(distances)
    return float(np.median(together)) if len(together) else 1.0


def depth_ranges(captures: Sequence[Capture], sparse: SparsePoints) -> list[tuple[float, float]]:
    """(near, far) planar depths per capture that hold its surroundings, for dense stereo.

    Robust ends of the depths of the points it measured, else of those in its view, else
    of all, widened for surfaces that have no features. Same unit as the points. Without any point, what is
    usual in a room: then the unit is the metre.
    """
    if not len(sparse.points):
        return [_USUAL_RANGE_M] * len(captures)
    ranges = []
    for index, capture in enumerate(captures):
        pixels, depth = capture.camera.project(sparse.points)
        choices = (sparse.visibility[:, index], capture.camera.sees(pixels, depth))
        for chosen in choices:
            measured = depth[chosen & (depth > 0)]
            if len(measured) >= _RANGE_MIN_POINTS:
                break
        else:
            measured = np.linalg.norm(sparse.points - capture.camera.centre, axis=1)
        near, far = np.percentile(measured, _RANGE_PERCENTILES)
        ranges.append((float(near * _RANGE_MARGIN[0]), float(far * _RANGE_MARGIN[1])))
    return ranges
