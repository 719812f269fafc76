"""Which photographs show the same things: their features matched pair by pair."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...config.settings import CaptureSettings
from ...core.cameras import Camera
from ...core.errors import CaptureError, NoOverlapError
from ...core.progress import Progress
from ...core.threads import in_threads
from ..colmap import load_pycolmap
from .features import Features, epipolar_errors, match, match_along_epipolar_lines
from .neighbours import neighbours

# Matches between poses that are known are searched in a narrow band, where a nearest
# descriptor always exists: beyond this distance (of descriptors of length 512) it is chance.
_LARGEST_DESCRIPTOR_DISTANCE = 0.5 * 512.0
# Of the plain matches of two photographs with right poses 35 to 90 % agree with them.
_MIN_AGREEING_SHARE = 0.2
# This many plain matches that contradict the poses mean overlap with wrong poses.
_CONTRADICTING_MATCHES = 60

# Of 55 photographs of an office, and of 42 views of a room at random, ten find every pair that overlaps.
_NEAREST = 16
# What is taken to be seen: along so many rays, so far away in median distances of two cameras.
_RAYS_A_SIDE = 3
_DEPTHS = (0.25, 0.5, 1.0)

OVERLAP_CURE = "Photograph the same room from viewpoints that overlap by half, sharp and well lit."
"""What helps where photographs share too little."""

Pairs = dict[tuple[int, int], np.ndarray]
"""Matches (m, 2) int32 of feature indices for pairs (i, j), i < j, of photographs."""


class Matched(NamedTuple):
    """Features of photographs, and which of them match."""

    features: list[Features]
    pairs: Pairs

    def beside(self, other: Matched) -> Matched:
        """Both of the same photographs, this one's features first."""
        features = [
            Features(np.concatenate([mine.keypoints, more.keypoints]), mine.descriptors)
            for mine, more in zip(self.features, other.features, strict=True)
        ]
        pairs = dict(self.pairs)
        for (i, j), matches in other.pairs.items():
            beyond = matches + np.array([len(self.features[k].keypoints) for k in (i, j)], np.int32)
            pairs[i, j] = np.concatenate([pairs.get((i, j), beyond[:0]), beyond])
        return Matched(features, pairs)


def match_all(
    features: Sequence[Features],
    settings: CaptureSettings,
    progress: Progress,
    title: str = "Matching photographs",
    among: Sequence[tuple[int, int]] | None = None,
) -> Pairs:
    """Mutual ratio-test matches of every pair, or every one ``among``, that has ``min_matches`` of them."""
    indices = list(combinations(range(len(features)), 2)) if among is None else among

    def matched(pair: tuple[int, int]) -> np.ndarray:
        a, b = (features[index].descriptors for index in pair)
        return match(a, b, settings.match_ratio)

    found = zip(indices, in_threads(matched, indices, progress, title), strict=True)
    return {pair: matches for pair, matches in found if len(matches) >= settings.min_matches}


def near_pairs(cameras: Sequence[Camera]) -> list[tuple[int, int]]:
    """The pairs (i, j), i < j, of cameras that see most of the same places, sixteen for each at most.

    Where the surfaces are is not known yet: places before a camera are as far as cameras are apart.
    """
    every = list(combinations(range(len(cameras)), 2))
    if len(cameras) <= _NEAREST + 1:
        return every
    apart = np.median([np.linalg.norm(cameras[i].centre - cameras[j].centre) for i, j in every])
    places = [
        coarse.unproject(np.full(coarse.shape, depth * apart)).reshape(-1, 3)
        for coarse in (camera.fitted(_RAYS_A_SIDE) for camera in cameras)
        for depth in _DEPTHS
    ]
    near = neighbours(cameras, np.concatenate(places), _NEAREST)
    return sorted({(min(i, j), max(i, j)) for i, others in enumerate(near) for j in others}) or every


def confirming(
    plain: Pairs,
    features: Sequence[Features],
    cameras: Sequence[Camera],
    max_error_px: float,
    settings: CaptureSettings,
) -> Pairs:
    """Of the matches of ``match_all`` those within ``max_error_px`` of their epipolar lines.

    A pair is kept, as overlapping, when these are ``min_matches`` and a fifth of its matches
    at least, of SIFT or of the other matcher, whose mistakes agree with each other where a room
    repeats itself. Raises NoOverlapError when no pair is, and CaptureError where poses
    contradict what overlaps.
    """
    pairs: Pairs = {}
    contradicting = 0
    for (i, j), matches in plain.items():
        places = features[i].keypoints[matches[:, 0]], features[j].keypoints[matches[:, 1]]
        agree = epipolar_errors(*places, cameras[i], cameras[j]) <= max_error_px
        of_sift = matches[:, 0] < len(features[i].descriptors)
        for kind in (of_sift, ~of_sift):
            agreeing = kind & agree
            if agreeing.sum() >= max(settings.min_matches, _MIN_AGREEING_SHARE * kind.sum()):
                pairs[i, j] = np.concatenate([pairs.get((i, j), matches[:0]), matches[agreeing]])
            elif kind is of_sift:
                contradicting = max(contradicting, int(kind.sum() - agreeing.sum()))
    if not pairs:
        raise _nothing_overlaps(contradicting, settings)
    return pairs


def match_guided(
    overlapping: Pairs,
    features: Sequence[Features],
    cameras: Sequence[Camera],
    names: Sequence[str],
    settings: CaptureSettings,
    progress: Progress,
    plain: Pairs | None = None,
) -> Pairs:
    """The matches of overlapping pairs, looked for along the epipolar lines of known poses.

    Those of the other matcher are as they were in ``overlapping``, which ``confirming`` gave.
    Captures that overlap with none are named in a warning, those apart whose poses contradict many of the
    ``plain`` matches.
    """

    def guided(pair: tuple[int, int]) -> np.ndarray:
        (i, j), matches = pair, overlapping[pair]
        a, b = features[i], features[j]
        found = match_along_epipolar_lines(a, b, cameras[i], cameras[j], settings.max_error_px, settings.match_ratio)
        difference = a.descriptors[found[:, 0]].astype(np.float32) - b.descriptors[found[:, 1]]
        near = np.einsum("ij,ij->i", difference, difference) <= _LARGEST_DESCRIPTOR_DISTANCE**2
        beyond = matches[matches[:, 0] >= len(a.descriptors)]
        return np.concatenate([found[near], beyond])

    pairs = dict(zip(overlapping, in_threads(guided, overlapping, progress, "Matching captures"), strict=True))
    alone = sorted(set(range(len(names))) - {index for pair in pairs for index in pair})
    contradicting = {
        index: most
        for index in alone
        if (most := max((len(m) for pair, m in (plain or {}).items() if index in pair), default=0))
        >= _CONTRADICTING_MATCHES
    }
    for index, most in contradicting.items():
        progress.message(
            f"{names[index]}: its pose contradicts what it shares with other captures ({most} matches with one "
            "of them), so nothing seen only there can be measured",
            level="warning",
        )
    if alone := [index for index in alone if index not in contradicting]:
        progress.message(
            f"{_listed(names[i] for i in alone)}: shares fewer than {settings.min_matches} matches "
            "with any other capture, so nothing seen only there can be measured",
            level="warning",
        )
    return pairs


def _nothing_overlaps(contradicting: int, settings: CaptureSettings) -> CaptureError:
    if contradicting >= _CONTRADICTING_MATCHES:
        return CaptureError(
            f"the photographs overlap ({contradicting} matches in the best pair), but their poses "
            "contradict every match",
            where="camera poses",
            cure="Check the axis convention (OpenCV world_from_camera in cameras.json, OpenGL in "
            "transforms.json), the order of the poses, the focal length, and whether photographs that EXIF "
            "turns by 180 degrees were turned when the poses were solved.",
        )
    return NoOverlapError(
        f"no two photographs share {settings.min_matches} matches that fit their poses",
        where="captures",
        cure=OVERLAP_CURE,
    )


def write_database(
    path: Path,
    cameras: Sequence,
    camera_of: Sequence[int],
    names: Sequence[str],
    features: Sequence[Features],
    pairs: Pairs,
    *,
    verified: bool,
) -> list[int]:
    """Write a COLMAP database; call it in a child process. Returns the image ids.

    ``cameras`` are pycolmap cameras and ``camera_of[i]`` the one of photograph i. Matches
    are written as such, or with ``verified`` as the inliers of a two-view geometry.
    """
    pycolmap = load_pycolmap()
    with pycolmap.Database.open(path) as database:
        camera_ids = [database.write_camera(camera) for camera in cameras]
        for index, camera_id in enumerate(camera_ids):
            rig = pycolmap.Rig(rig_id=index + 1)
            rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_id))
            database.write_rig(rig, use_rig_id=True)
        ids = []
        for index, (name, found) in enumerate(zip(names, features, strict=True)):
            image = pycolmap.Image(name=name, camera_id=camera_ids[camera_of[index]], image_id=index + 1)
            image_id = database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame(frame_id=index + 1, rig_id=camera_of[index] + 1)
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            database.write_keypoints(image_id, found.keypoints)
            database.write_descriptors(
                image_id, pycolmap.FeatureDescriptors(pycolmap.FeatureExtractorType.SIFT, found.descriptors)
            )
            ids.append(image_id)
        for (i, j), matches in sorted(pairs.items()):
            database.write_matches(ids[i], ids[j], matches.astype(np.uint32))
            if verified:
                geometry = pycolmap.TwoViewGeometry(
                    config=pycolmap.TwoViewGeometryConfiguration.CALIBRATED, inlier_matches=matches.astype(np.uint32)
                )
                database.write_two_view_geometry(ids[i], ids[j], geometry)
    return ids


def save_matches(path: Path, features: Sequence[Features], pairs: Pairs) -> None:
    """Write features and matches as an ``.npz`` for a child process."""
    arrays: dict[str, Any] = {}
    for index, found in enumerate(features):
        arrays[f"keypoints_{index}"] = found.keypoints
        arrays[f"descriptors_{index}"] = found.descriptors
    for (i, j), matches in pairs.items():
        arrays[f"matches_{i}_{j}"] = matches
    np.savez(path, **arrays)


def load_matches(path: Path) -> tuple[list[Features], Pairs]:
    """Read what ``save_matches`` wrote."""
    with np.load(path, allow_pickle=False) as data:
        count = sum(name.startswith("keypoints_") for name in data.files)
        features = [Features(data[f"keypoints_{i}"], data[f"descriptors_{i}"]) for i in range(count)]
        pairs = {}
        for name in data.files:
            if name.startswith("matches_"):
                _, i, j = name.split("_")
                pairs[int(i), int(j)] = data[name]
    return features, pairs


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
