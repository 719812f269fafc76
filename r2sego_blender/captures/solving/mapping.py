"""Incremental and global mapping of matched photographs with COLMAP, in a child process: which register, and where.

A model is a list of images as JSON: ``index`` of the photograph, ``camera`` (``camera_to_json``) and
``camera_from_world`` (3, 4).
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...core.cameras import Camera
from ...core.errors import CaptureError
from ...core.resources import available_cores
from ..colmap import load_pycolmap
from ..matching.features import Features, epipolar_errors
from ..matching.overlap import Matched, load_matches, write_database
from ..poses.colmap_model import camera_to_json, lens_from_json
from ..poses.photographs import MIN_CAPTURES
from .place_certainty import View, place_deviations
from .solved_lenses import can_be_undone, with_lenses_that_can_be_undone
from .starting_lenses import cameras_of_their_own, solved_cameras, starting_cameras

Images = list[dict[str, Any]]

ADVICE = (
    "Take more photographs between those: walk sideways a step at a time, never turn on the spot, "
    "keep half of each picture in the next, hold still in good light so that nothing is blurred."
)
"""What helps where photographs cannot be registered."""


class _Try(NamedTuple):
    """What COLMAP asks of a pair to start from, inliers and degrees, and of each next photograph, inliers."""

    first_inliers: int
    first_angle_deg: float
    next_inliers: int


# COLMAP's defaults ask for 100 inliers and 16 degrees of the first pair and 30 inliers of
# the next ones, which a few photographs taken a step apart may not offer; the later tries
# are more modest.
_TRIES = (_Try(100, 16.0, 30), _Try(100, 16.0, 15), _Try(50, 8.0, 15), _Try(30, 4.0, 15))
# Through a lens that is known, eight points place a photograph, and points that two photographs alone
# see count too. Without it they bend the lens to their mistakes.
_HELD = _Try(30, 4.0, 8)
# Global positioning starts at random: one of so many starts ends where most matches agree.
_GLOBAL_STARTS = 8
# In shares of how far places spread: from here on a place is not told. Told ones have 0.02.
_MOST_DEVIATION = 0.2
# Of the reprojection error under a shared lens, what lenses of their own may leave: right ones
# leave 0.95 of it, and 0.1 where some photographs are zoomed.
_CLEARLY_LOWER = 0.75
# From this start, matches that determine the lens lead to the focal length that the usual start leads
# to, within 0.1 %; where they do not, it is 3 to 100 % off.
_OTHER_FOCAL_GUESS = 1.2
_SAME_FOCAL = 0.01
_DATABASE = "database.db"
MIN_AGREEING_SHARE = 0.25
"""Of its matches, with which a photograph agrees at least.

One registered to a wrong place contradicts most of its matches: of a right one 40 to 70 % lie on their epipolar lines
(the rest are wrong matches), of a wrong one 15 %.
"""

AGREEMENT_PX = 4.0
"""By which a match may lie off its epipolar lines and agree with a model, at the size at which it is solved."""


def map_in_child(request: dict[str, Any]) -> dict[str, Any]:
    """``models`` of photographs, and whether the matches have ``determined`` their lens; runs in a child process.

    The request holds ``folder`` with ``matches.npz``, the photographs' ``paths`` and ``sizes``, and ``min_matches``;
    ``lens_from``, a model, holds its lenses as they are, and ``globally`` has all that pairs join placed at once
    through them; ``compare`` asks whether the lens is determined, where all that have matches register.
    """
    os.chdir(request["folder"])  # Windows' COLMAP opens no database by a path of letters beyond the system's
    folder = Path()
    matched = Matched(*load_matches(folder / "matches.npz"))
    min_matches = request["min_matches"]
    shared = starting_cameras(request["paths"], request["sizes"])
    if request["lens_from"]:
        lenses = solved_cameras(*shared, request["lens_from"])
        if request["globally"]:
            return {"models": _mapped_globally(folder / "global", lenses, matched, min_matches), "determined": True}
        return {"models": _mapped(folder / "held", lenses, matched, min_matches, held=True).models, "determined": True}
    best = _mapped(folder / "shared", shared, matched, min_matches)
    most = _photographs_with_matches(matched)
    known = all(camera.has_prior_focal_length for camera in shared[0])
    share_lens = True
    if len(shared[0]) < len(matched.features) and not (known and best.registered == most):
        # Zoomed photographs without EXIF spoil the lens that they share, though all may register.
        own = _mapped(folder / "own", cameras_of_their_own(*shared), matched, min_matches)
        better = own.error_px < _CLEARLY_LOWER * best.error_px
        if own.registered > best.registered or (own.registered == best.registered and better):
            best, share_lens = own, False
    determined = True
    if request["compare"] and not known and best.registered == most:
        start = starting_cameras(request["paths"], request["sizes"], _OTHER_FOCAL_GUESS)
        lenses = start if share_lens else cameras_of_their_own(*start)
        verified = folder / ("shared" if share_lens else "own")
        other = _mapped(folder / "other", lenses, matched, min_matches, verified=verified)
        off = abs(np.log(other.relative_focal / best.relative_focal)) if other.registered == most else np.inf
        determined = bool(off <= _SAME_FOCAL)
    return {"models": best.models, "determined": determined}


def agreements(images: Images, matched: Matched, within_px: float) -> dict[int, np.ndarray]:
    """For each photograph of a model (2,): how many of its matches lie on their epipolar lines, and of how many."""
    views = {image["index"]: pinhole_view(image, matched.features[image["index"]]) for image in images}
    return agreements_of_views(views, matched, within_px)


def agreements_of_views(views: Mapping[int, View], matched: Matched, within_px: float) -> dict[int, np.ndarray]:
    """The same of photographs' cameras and keypoints."""
    counts = {index: np.zeros(2, np.int64) for index in views}
    for (i, j), matches in matched.pairs.items():
        if i in views and j in views:
            (camera_i, pixels_i), (camera_j, pixels_j) = views[i], views[j]
            errors = epipolar_errors(pixels_i[matches[:, 0]], pixels_j[matches[:, 1]], camera_i, camera_j)
            for index in (i, j):
                counts[index] += (errors <= within_px).sum(), len(matches)
    return counts


class _Mapped(NamedTuple):
    """Models, the largest first, and its mean reprojection error."""

    models: list[Images]
    error_px: float = np.inf

    @property
    def registered(self) -> int:
        """The photographs of the largest model."""
        return len(self.models[0]) if self.models else 0

    @property
    def relative_focal(self) -> float:
        """Focal length of its first photograph, in longest sides."""
        camera = self.models[0][0]["camera"]
        return camera["focal"][0] / max(camera["width"], camera["height"])


def _photographs_with_matches(matched: Matched) -> int:
    return len({index for pair in matched.pairs for index in pair})


def _mapped(
    folder: Path,
    lenses: tuple[list[Any], list[int]],
    matched: Matched,
    min_matches: int,
    held: bool = False,
    verified: Path | None = None,
) -> _Mapped:
    """The models of the try that registers most photographs; ``held`` lenses stay as they are.

    ``verified`` is the folder of an earlier one whose lenses differed by guessed focal lengths alone, of which the
    geometry of a pair knows nothing.
    """
    if verified is None:
        database, index_of = _verified(folder, lenses, matched, min_matches)
    else:
        database, index_of = _verified_before(verified, folder, lenses)
    _require_depth(database, len(matched.features))
    best = _Mapped([])
    most = _photographs_with_matches(matched)
    for attempt, one in enumerate((_HELD,) if held else _TRIES):
        found = _models(database, folder / f"models{attempt}", one, min_matches, held)
        told = [(_trustworthy(_images(model, index_of), matched), model) for model in found]
        told.sort(key=lambda pair: -len(pair[0]))
        if told and len(told[0][0]) > best.registered:
            best = _Mapped([images for images, _ in told], told[0][1].compute_mean_reprojection_error())
        if best.registered == most:
            break
    return best


def _mapped_globally(
    folder: Path, lenses: tuple[list[Any], list[int]], matched: Matched, min_matches: int
) -> list[Images]:
    """The models of global mapping (Pan and others, "Global Structure-from-Motion Revisited", ECCV 2024), through
    lenses as they are, of the start with which most matches agree.

    Rotations are averaged over all pairs, and points of two photographs count for places: groups that no point of
    three photographs joins are joined where their pairs close a loop.
    """
    pycolmap = load_pycolmap()
    database, index_of = _verified(folder, lenses, matched, min_matches)
    options = pycolmap.GlobalPipelineOptions(num_threads=1, min_num_matches=min_matches, min_model_size=MIN_CAPTURES)
    mapper = options.mapper
    mapper.num_threads = 1
    mapper.track_min_num_views_per_track = mapper.global_positioning.min_num_view_per_track = 2
    mapper.bundle_adjustment.min_track_length = 2
    mapper.retriangulation.ignore_two_view_tracks = False
    mapper.bundle_adjustment.refine_focal_length = mapper.bundle_adjustment.refine_extra_params = False
    mapper.global_positioning.use_gpu = mapper.bundle_adjustment.ceres.use_gpu = False
    best: tuple[int, list[Images]] = (0, [])
    for start in range(_GLOBAL_STARTS):
        output = folder / f"models{start}"
        output.mkdir()
        for seeded in (options, mapper, mapper.rotation_averaging, mapper.global_positioning, mapper.retriangulation):
            seeded.random_seed = start
        pycolmap.set_random_seed(start)
        found = pycolmap.global_mapping(database, output, output, options).values()
        models = [_images(with_lenses_that_can_be_undone(one), index_of) for one in found]
        models = sorted((_told(_trustworthy(one, matched), matched) for one in models), key=len, reverse=True)
        counts = agreements(models[0], matched, AGREEMENT_PX) if models else {}
        best = max(best, (sum(int(agree) for agree, _ in counts.values()), models), key=lambda pair: pair[0])
    return best[1]


def _verified_before(before: Path, folder: Path, lenses: tuple[list[Any], list[int]]) -> tuple[Path, dict[int, int]]:
    """What ``_verified`` made in the folder ``before``, in a new folder and with these cameras' parameters."""
    pycolmap = load_pycolmap()
    folder.mkdir()
    database = folder / _DATABASE
    shutil.copyfile(before / _DATABASE, database)
    with pycolmap.Database.open(database) as copied:
        for known, camera in zip(copied.read_all_cameras(), lenses[0], strict=True):
            known.params = camera.params
            copied.update_camera(known)
        return database, {image.image_id: int(image.name) for image in copied.read_all_images()}


def _verified(
    folder: Path, lenses: tuple[list[Any], list[int]], matched: Matched, min_matches: int
) -> tuple[Path, dict[int, int]]:
    """A database in a new folder with the geometry of each pair; and the photographs by COLMAP's number."""
    pycolmap = load_pycolmap()
    folder.mkdir()
    database = folder / _DATABASE
    names = [f"{index:06d}" for index in range(len(matched.features))]
    ids = write_database(database, *lenses, names, *matched, verified=False)
    verification = pycolmap.TwoViewGeometryOptions(min_num_inliers=min_matches)
    verification.ransac.random_seed = 0
    pycolmap.set_random_seed(0)
    pycolmap.geometric_verification(
        database,
        pycolmap.GeometricVerifierOptions(num_threads=available_cores()),
        two_view_geometry_options=verification,
    )  # each pair's random numbers begin anew, on whichever thread
    return database, {image_id: index for index, image_id in enumerate(ids)}


def _require_depth(database: Path, count: int) -> None:
    """Raises CaptureError where the pairs of ``count`` photographs that join them are all flat."""
    pycolmap = load_pycolmap()
    with pycolmap.Database.open(database) as verified:
        kinds = [geometry.config for geometry in verified.read_two_view_geometries()[1]]
    kind = pycolmap.TwoViewGeometryConfiguration
    told = [one for one in kinds if one != kind.DEGENERATE]
    flat = {kind.PLANAR, kind.PANORAMIC, kind.PLANAR_OR_PANORAMIC}
    # Fewer pairs do not join the photographs: then they overlap too little, flat or not.
    if len(told) >= count - 1 and set(told) <= flat:
        raise CaptureError(
            "the photographs show no depth, as when all are taken from one spot or of one flat wall",
            where="camera poses",
            cure=ADVICE,
        )


def _models(database: Path, output: Path, one: _Try, min_matches: int, held: bool) -> list[Any]:
    pycolmap = load_pycolmap()
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
    options.mapper.init_min_num_inliers = one.first_inliers
    options.mapper.init_min_tri_angle = one.first_angle_deg
    options.mapper.abs_pose_min_num_inliers = one.next_inliers if held else max(one.next_inliers, min_matches)
    if held:
        options.ba_refine_focal_length = options.ba_refine_extra_params = False
        options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
        options.triangulation.ignore_two_view_tracks = False
    pycolmap.set_random_seed(0)
    output.mkdir()
    models = pycolmap.incremental_mapping(database, output, output, options)
    return [with_lenses_that_can_be_undone(model) for model in models.values()]


def _images(model: Any, index_of: dict[int, int]) -> Images:
    """The images of a pycolmap model, but those whose lens came out as none."""
    images = {index_of[image_id]: model.images[image_id] for image_id in model.reg_image_ids()}
    return [
        {
            "index": index,
            "camera": camera_to_json(image.camera),
            "camera_from_world": image.cam_from_world().matrix().tolist(),
        }
        for index, image in sorted(images.items())
        if can_be_undone(image.camera)
    ]


def _told(images: Images, matched: Matched) -> Images:
    """Those of a model whose places its matches tell, each in one scale with the others."""
    while images:
        views = {image["index"]: pinhole_view(image, matched.features[image["index"]]) for image in images}
        deviations = place_deviations(views, matched, AGREEMENT_PX)
        worst = max(deviations, key=lambda index: deviations[index])
        if deviations[worst] <= _MOST_DEVIATION:
            break
        images = [image for image in images if image["index"] != worst]
    return images


def _trustworthy(images: Images, matched: Matched) -> Images:
    """Those of a model whose matches agree with its poses."""
    counts = agreements(images, matched, AGREEMENT_PX)
    right = {index for index, (agreeing, total) in counts.items() if agreeing >= MIN_AGREEING_SHARE * max(total, 1)}
    return [image for image in images if image["index"] in right]


def pinhole_view(image: dict[str, Any], features: Features) -> View:
    """An image's pose as a pinhole camera, and its keypoints (n, 2) freed of distortion."""
    lens = lens_from_json(image["camera"], str(image["index"]))
    focal = lens.fx
    pose = np.linalg.inv(np.vstack([image["camera_from_world"], [0.0, 0.0, 0.0, 1.0]]))
    camera = Camera(lens.width, lens.height, focal, focal, lens.cx, lens.cy, pose)
    return camera, lens.rays(features.keypoints) * focal + [lens.cx, lens.cy]
