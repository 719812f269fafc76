"""Poses of plain photographs: incremental structure from motion, seeded, in a child process."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from copy import copy
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from ...config.settings import CaptureSettings
from ...core.cameras import Camera
from ...core.errors import CaptureError
from ...core.images import DAMAGED, load_image, resize
from ...core.progress import Progress
from ...core.scratch import ScratchFolder
from ...workers.child import call_in_child
from ..colmap import load_pycolmap
from ..keyframes.choosing import photograph_keyframes
from ..matching.features import Features, epipolar_errors, sift
from ..matching.overlap import Matched, Pairs, load_matches, match_all, save_matches, write_database
from ..matching.xfeat import LEAST_EXPECTED, NAME, match_xfeat, runs
from ..poses.colmap_model import camera_to_json, lens_from_json
from ..poses.photographs import MIN_CAPTURES, Photograph
from ..poses.plain_folder import plain_photographs
from .solved_lenses import with_lenses_that_can_be_undone

_MIN_REGISTERED_SHARE = 0.6
# COLMAP's defaults ask for 100 inliers and 16 degrees of the first pair and 30 inliers of
# the next ones, which a few photographs taken a step apart may not offer; the later tries
# are more modest.
_TRIES = ((100, 16.0, 30), (100, 16.0, 15), (50, 8.0, 15), (30, 4.0, 15))
# A photograph registered to a wrong place contradicts most of its matches: of a right one
# 40 to 70 % lie on their epipolar lines (the rest are wrong matches), of a wrong one 15 %.
_MIN_AGREEING_SHARE = 0.25
_AGREEMENT_PX = 4.0
# Of the reprojection error under a shared lens, what lenses of their own may leave: right ones
# leave 0.95 of it, and 0.1 where some photographs are zoomed.
_CLEARLY_LOWER = 0.75
# Focal length, in longest sides, of a photograph without EXIF: a phone's main camera and
# most compact cameras lie between 0.7 and 1; refined by the bundle adjustment.
_FOCAL_GUESS = 0.85
# EXIF rounds focal lengths, and a solved one is as good: more than this tells another picture.
_EXIF_AGREES = 0.1
_PLENTY = 100  # so many of SIFT's matches in a pair are no mistake
_TIMEOUT_S = 3600.0
_ADVICE = (
    "Take more photographs between those: walk sideways a step at a time, never turn on the spot, "
    "keep half of each picture in the next, hold still in good light so that nothing is blurred."
)


def solve_poses(
    folder: Path, settings: CaptureSettings, progress: Progress, names: Sequence[str] = ()
) -> tuple[list[Photograph], str]:
    """The photographs in ``folder`` with estimated lenses and poses, up to an unknown similarity.

    Of more than ``settings.max_keyframes`` as many are chosen; ``names`` chooses otherwise.
    Focal lengths start from EXIF where it has them. Photographs of one size and focal length
    share a lens, unless they fit clearly better with one each. Also returns a line saying how
    many registered. Raises CaptureError when fewer than three, or fewer than 60 %, do.
    """
    paths = photograph_keyframes(plain_photographs(folder, progress), settings.max_keyframes, progress, names)
    features: list[Features] = []
    sizes = []
    for path in progress.track(paths, "Solving camera poses: features"):
        image = _sized(path, settings)
        sizes.append((image.shape[1], image.shape[0]))
        features.append(sift(image, settings.max_features))
    matched = Matched(features, match_all(features, settings, progress, "Solving camera poses: matches"))
    wider = settings.matcher == "xfeat" and runs()
    models: list[list[dict[str, Any]]] = []
    failure = None
    try:
        models = _models(paths, sizes, matched, settings, progress)
    except CaptureError as error:
        failure = error
    matched_by = ""
    if wider and len(models[0] if models else ()) < len(paths):
        # Not from the start: what SIFT solves alone, it solves more exactly. Where it does not, its
        # matches are mistakes in part, and harm.
        further = match_xfeat(
            [_sized(path, settings) for path in paths],
            list(combinations(range(len(paths)), 2)),
            settings,
            progress,
            "Solving camera poses: wide baselines",
            LEAST_EXPECTED,
        )
        for beside in (" and SIFT", ""):  # SIFT's matches are three times as exact where they are right
            if further is None or not further.pairs or len(models[0] if models else ()) == len(paths):
                break
            sure = {
                pair: found for pair, found in matched.pairs.items() if pair in further.pairs or len(found) >= _PLENTY
            }
            both = Matched(features, sure).beside(further) if beside else further
            with contextlib.suppress(CaptureError):
                again = _models(paths, sizes, both, settings, progress)
                if len(again[0] if again else ()) > len(models[0] if models else ()):
                    models, matched_by = again, f", matched with {NAME}{beside}"
    if failure and not models:
        raise failure
    best = models[0] if models else []
    registered = {image["index"] for image in best}
    fallen = [path.name for index, path in enumerate(paths) if index not in registered]
    count = f"{len(best)} of {len(paths)} photographs"
    if len(best) < MIN_CAPTURES or len(best) < _MIN_REGISTERED_SHARE * len(paths):
        several = f" (in {len(models)} separate groups, as of several rooms)" if len(models) > 1 else ""
        raise CaptureError(
            f"only {count} could be registered together{several}; left out: {', '.join(fallen)}",
            where=folder,
            cure=_ADVICE,
        )
    if fallen:
        progress.message(f"{count} registered; left out: {', '.join(fallen)}. {_ADVICE}", level="warning")
    photographs = []
    for one in sorted(best, key=lambda one: one["index"]):
        path = paths[one["index"]]
        lens = lens_from_json(one["camera"], str(path))
        pose = np.linalg.inv(np.vstack([one["camera_from_world"], [0.0, 0.0, 0.0, 1.0]]))
        photographs.append(Photograph(path.name, path, lens, pose, str(path)))
    _tell_other_pictures(photographs, progress)
    return photographs, f"structure from motion, {count}{matched_by}"


def _sized(path: Path, settings: CaptureSettings) -> np.ndarray:
    """The photograph (H, W, 3) float32 at the size at which it is solved."""
    image = load_image(path)
    height, width = image.shape[:2]
    scale = min(1.0, settings.solve_max_side_px / max(width, height))
    return resize(image, max(1, round(width * scale)), max(1, round(height * scale)))


def _models(
    paths: Sequence[Path],
    sizes: Sequence[tuple[int, int]],
    matched: Matched,
    settings: CaptureSettings,
    progress: Progress,
) -> list[list[dict[str, Any]]]:
    """The models of ``solve_in_child``, the largest first."""
    if not matched.pairs:
        raise CaptureError(
            f"no two of the {len(paths)} photographs share {settings.min_matches} features",
            where=paths[0].parent,
            cure=_ADVICE,
        )
    with progress.task("Solving camera poses", total=1) as task, ScratchFolder() as scratch:
        save_matches(Path(scratch, "matches.npz"), matched.features, matched.pairs)
        request = {
            "folder": scratch,
            "paths": [str(path.absolute()) for path in paths],
            "sizes": sizes,
            "min_matches": settings.min_matches,
        }
        found = call_in_child(solve_in_child, request, timeout_s=_TIMEOUT_S)
        task.advance()
    return sorted(found["models"], key=len, reverse=True)


def _tell_other_pictures(photographs: Sequence[Photograph], progress: Progress) -> None:
    """Say of which photographs EXIF tells the focal length of another picture, as of one before it was cropped."""
    told: dict[str, list[str]] = {}
    for one in photographs:
        relative, found = focal_of_exif(str(one.path)), one.lens.fx / max(one.lens.width, one.lens.height)
        if relative is not None and abs(np.log(found / relative)) > _EXIF_AGREES:
            told.setdefault(f"{relative:.2f} of the longest side, the photographs {found:.2f}", []).append(one.name)
    for words, names in told.items():
        progress.message(f"{', '.join(names)}: EXIF says a focal length of {words}, which was taken: cropped pictures?")


def solve_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """Incremental mapping with pycolmap; runs in a child process."""
    os.chdir(request["folder"])  # Windows' COLMAP opens no database by a path of letters beyond the system's
    folder = Path()
    features, pairs = load_matches(folder / "matches.npz")
    matched = {index for pair in pairs for index in pair}
    shared = _cameras(request["paths"], request["sizes"])
    best = _solved(folder / "shared", shared, features, pairs, len(matched), request["min_matches"])
    known = all(camera.has_prior_focal_length for camera in shared[0])
    if len(shared[0]) < len(features) and not (known and best.registered == len(matched)):
        # Zoomed photographs without EXIF spoil the lens that they share, though all may register.
        own = _own_cameras(*shared)
        single = _solved(folder / "own", own, features, pairs, len(matched), request["min_matches"])
        better = single.error_px < _CLEARLY_LOWER * best.error_px
        if single.registered > best.registered or (single.registered == best.registered and better):
            best = single
    return {"models": best.models}


class _Solved(NamedTuple):
    """Models as lists of JSON-ready images; the size and mean reprojection error of the largest."""

    models: list[list[dict[str, Any]]]
    registered: int = 0
    error_px: float = np.inf


def _solved(
    folder: Path,
    lenses: tuple[list, list[int]],
    features: Sequence[Features],
    pairs: Pairs,
    most: int,
    min_matches: int,
) -> _Solved:
    """The models of the try that registers most photographs, under the cameras of ``_cameras``."""
    pycolmap = load_pycolmap()
    folder.mkdir()
    database = folder / "database.db"
    names = [f"{index:06d}" for index in range(len(features))]
    ids = write_database(database, *lenses, names, features, pairs, verified=False)
    verification = pycolmap.TwoViewGeometryOptions(min_num_inliers=min_matches)
    verification.ransac.random_seed = 0
    pycolmap.set_random_seed(0)
    pycolmap.geometric_verification(
        database, pycolmap.GeometricVerifierOptions(num_threads=1), two_view_geometry_options=verification
    )
    with pycolmap.Database.open(database) as verified:
        kinds = [geometry.config for geometry in verified.read_two_view_geometries()[1]]
    kind = pycolmap.TwoViewGeometryConfiguration
    told = [one for one in kinds if one != kind.DEGENERATE]
    flat = {kind.PLANAR, kind.PANORAMIC, kind.PLANAR_OR_PANORAMIC}
    # Fewer pairs do not join the photographs: then they overlap too little, flat or not.
    if len(told) >= len(features) - 1 and set(told) <= flat:
        raise CaptureError(
            "the photographs show no depth, as when all are taken from one spot or of one flat wall",
            where="camera poses",
            cure=_ADVICE,
        )
    index_of = {image_id: index for index, image_id in enumerate(ids)}
    best = _Solved([])
    for attempt, thresholds in enumerate(_TRIES):
        models = _map(database, folder / f"models{attempt}", thresholds, min_matches)
        found = [_trustworthy(model, index_of, features, pairs) for model in models]
        largest = max(range(len(found)), key=lambda index: len(found[index]), default=None)
        if largest is not None and len(found[largest]) > best.registered:
            error_px = models[largest].compute_mean_reprojection_error()
            best = _Solved(found, len(found[largest]), error_px)
        if best.registered == most:
            break
    return best


def _map(database: Path, output: Path, thresholds: tuple[int, float, int], min_matches: int) -> list[Any]:
    pycolmap = load_pycolmap()
    inliers, angle_deg, next_inliers = thresholds

    options = pycolmap.IncrementalPipelineOptions(
        num_threads=1,
        random_seed=0,
        extract_colors=False,
        min_num_matches=min_matches,
        min_model_size=MIN_CAPTURES,
        multiple_models=True,
    )
    options.mapper.num_threads = 1
    options.mapper.random_seed = 0
    options.triangulation.random_seed = 0
    options.mapper.init_min_num_inliers = inliers
    options.mapper.init_min_tri_angle = angle_deg
    options.mapper.abs_pose_min_num_inliers = max(next_inliers, min_matches)
    pycolmap.set_random_seed(0)
    output.mkdir()
    models = pycolmap.incremental_mapping(database, output, output, options)
    return [with_lenses_that_can_be_undone(model) for model in models.values()]


def _trustworthy(
    model: Any, index_of: dict[int, int], features: Sequence[Features], pairs: Pairs
) -> list[dict[str, Any]]:
    """The images of a model whose matches agree with its poses, as JSON-ready dicts."""
    images = {index_of[image_id]: model.images[image_id] for image_id in model.reg_image_ids()}
    views = {index: _pinhole_view(image, features[index]) for index, image in images.items()}
    agreeing, total = dict.fromkeys(images, 0), dict.fromkeys(images, 0)
    for (i, j), matches in pairs.items():
        if i in views and j in views:
            (camera_i, pixels_i), (camera_j, pixels_j) = views[i], views[j]
            errors = epipolar_errors(pixels_i[matches[:, 0]], pixels_j[matches[:, 1]], camera_i, camera_j)
            for index in (i, j):
                agreeing[index] += int((errors <= _AGREEMENT_PX).sum())
                total[index] += len(matches)
    return [
        {
            "index": index,
            "camera": camera_to_json(image.camera),
            "camera_from_world": image.cam_from_world().matrix().tolist(),
        }
        for index, image in sorted(images.items())
        if agreeing[index] >= _MIN_AGREEING_SHARE * max(total[index], 1)
    ]


def _pinhole_view(image: Any, features: Features) -> tuple[Camera, np.ndarray]:
    """An image's pose as a pinhole camera, and its keypoints (n, 2) freed of distortion."""
    lens = image.camera
    focal, cx, cy = lens.mean_focal_length(), lens.principal_point_x, lens.principal_point_y
    rays = np.asarray(lens.cam_from_img(features.keypoints.astype(np.float64)))
    pose = np.linalg.inv(np.vstack([image.cam_from_world().matrix(), [0.0, 0.0, 0.0, 1.0]]))
    camera = Camera(lens.width, lens.height, focal, focal, cx, cy, pose)
    return camera, rays[:, :2] * focal + [cx, cy]


def _cameras(paths: Sequence[str], sizes: Sequence[Sequence[int]]) -> tuple[list[Any], list[int]]:
    """One camera for photographs of the same size and EXIF focal length, and whose is whose."""
    pycolmap = load_pycolmap()
    cameras: list[Any] = []
    camera_of: list[int] = []
    known: dict[tuple[int, int, bool, float], int] = {}
    for path, (width, height) in zip(paths, sizes, strict=True):
        told = focal_of_exif(path)
        prior, relative = told is not None, told or _FOCAL_GUESS
        key = (width, height, prior, round(relative, 4))
        if key not in known:
            known[key] = len(cameras)
            focal_px = relative * max(width, height)
            camera = pycolmap.Camera(
                model="SIMPLE_RADIAL", width=width, height=height, params=[focal_px, width / 2, height / 2, 0.0]
            )
            camera.has_prior_focal_length = prior
            cameras.append(camera)
        camera_of.append(known[key])
    return cameras, camera_of


def _own_cameras(cameras: Sequence, camera_of: Sequence[int]) -> tuple[list, list[int]]:
    """The cameras of ``_cameras``, one for each photograph."""
    return [copy(cameras[index]) for index in camera_of], list(range(len(camera_of)))


def focal_of_exif(path: str) -> float | None:
    """The focal length, in longest sides, that a photograph's EXIF tells COLMAP; None without."""
    pycolmap = load_pycolmap()
    try:
        guess = pycolmap.infer_camera_from_image(path)
    except (RuntimeError, ValueError):  # a format that COLMAP does not read, or its path cannot be told
        try:
            with Image.open(path) as image, ScratchFolder() as folder:
                stand_in = Path(folder, "exif.jpg")
                Image.new("L", image.size).save(stand_in, exif=image.getexif())
                guess = pycolmap.infer_camera_from_image(stand_in)
        except DAMAGED:  # damaged EXIF of a sound image
            return None
    if not guess.has_prior_focal_length:
        return None
    return guess.mean_focal_length() / max(guess.width, guess.height)
