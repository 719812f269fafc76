"""What a training on photographs alone starts from: images with poses, first points, and the unit.

Photographs are imported, and points read or triangulated (``splat_training``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ..captures.capture import Capture
from ..captures.frozen import load_frozen_views
from ..captures.importing import Imported, import_captures
from ..captures.masks import counted_pixels, with_masks_beside
from ..captures.poses import json_fields
from ..captures.poses.formats.cameras_json import FORMAT as CAMERAS_JSON
from ..captures.poses.photographs import ANY_SIZE_PX, listed, posed_captures, require_once_each
from ..captures.poses.ply_points import read_ply_points
from ..captures.poses.registry import FORMATS, find_poses, only_one, poses_beside
from ..captures.poses.transforms_json import read_transforms_json
from ..captures.sparse import triangulate
from ..captures.sparse_points import SparsePoints
from ..config.settings import CaptureSettings, Settings
from ..core.errors import CaptureError, SettingsError
from ..core.progress import SILENT, Progress
from ..splats.asset import SplatAsset
from ..splats.training.initialization import from_points
from ..splats.training.observations import Observation

_FEWEST_IMAGES = 2

_MEDIAN_DEPTH_M = 3.0
"""Where the poses' unit is unknown, the median point is taken to be this far away, as in a room:
sizes of Gaussians and the nearest distance drawn are metres."""


@dataclass(frozen=True)
class Start:
    """What a training starts from, in metres: ``metres_from_poses`` (4, 4) scales the poses' unit.

    ``points`` (P, 3) float64 and ``colours`` (P, 3) uint8 are the first Gaussians';
    ``held_out`` are the views to score on.
    """

    observations: tuple[Observation, ...]
    held_out: tuple[Capture, ...]
    points: np.ndarray
    colours: np.ndarray
    metres_from_poses: np.ndarray
    source: str

    def asset(self, settings: Settings, rng: np.random.Generator) -> SplatAsset:
        """The first Gaussians."""
        return from_points(self.points, self.colours, settings.training, rng)

    def in_poses(self, asset: SplatAsset) -> SplatAsset:
        """The asset in the poses' unit."""
        return asset.transformed(np.linalg.inv(self.metres_from_poses))


def prepare(
    captures: Path,
    poses: Path | None,
    points: Path | None,
    frozen: Path | None,
    hold_out: int | None,
    settings: Settings,
    progress: Progress = SILENT,
) -> Start:
    """Import photographs and find points; arguments and errors as in ``train_on_photographs``."""
    if frozen is not None and hold_out is not None:
        raise SettingsError(
            "the views to score are given twice", where="r2sego train", cure="Give --frozen or --hold-out."
        )
    if hold_out is not None and hold_out < 2:
        raise SettingsError(
            f"{hold_out} leaves no image to train on", where="--hold-out", cure="Give 2 at least; 8 is usual."
        )
    folder, poses = _folder_and_poses(captures, poses)
    if frozen is not None and poses is None:
        raise SettingsError(
            f"{folder} has no poses, and the frame in which they are solved is not that of the views to score",
            where="--frozen",
            cure="Give --poses in their frame, or --hold-out.",
        )
    # What can be wrong in them is told before poses are solved.
    frozen_views = () if frozen is None else _views_of(frozen)
    given_points = None if points is None else read_ply_points(points)
    imported = import_captures(folder, poses, settings.captures, progress)
    images, held = _split(with_masks_beside(imported.captures, folder), hold_out)
    held = held or frozen_views
    trained_on = {capture.image_path.resolve() for capture in images}
    if seen := [view.image_path for view in frozen_views if view.image_path.resolve() in trained_on]:
        progress.message(f"{listed(seen)}: trained on, too; scores of what was trained on say little", "warning")
    if len(images) < _FEWEST_IMAGES:
        raise CaptureError(
            f"{len(images)} image{'s are' if len(images) != 1 else ' is'} left to train on",
            where=folder,
            cure="Hold out fewer, or add photographs.",
        )
    side_px, limit_px = max(max(c.camera.shape) for c in images), settings.captures.max_side_px
    limit = ", as captures.max_side_px says" if side_px == limit_px else ""
    progress.message(f"{len(images)} images to train on, up to {side_px} pixels a side{limit}: {imported.source}")
    _tell_masks(images, held, poses, imported.masks, progress)
    xyz, colours = given_points or _first_points(images, poses, settings, progress)
    unit_m = _unit_m(imported, images, xyz, progress)
    to_metres = np.diag([unit_m, unit_m, unit_m, 1.0])
    return Start(
        observations=tuple(_observation(capture.transformed(to_metres)) for capture in images),
        held_out=tuple(view.transformed(to_metres) for view in held),
        points=xyz * unit_m,
        colours=colours,
        metres_from_poses=to_metres,
        source=imported.source,
    )


def holds_poses(path: Path) -> bool:
    """Whether it is a folder or a pose file, as training takes them; a cameras.json is of views."""
    return path.is_dir() or any(record.find(path) for record in FORMATS if record is not CAMERAS_JSON)


def posed_photographs(captures: Path) -> tuple[Capture, ...]:
    """The photographs with their cameras, undistorted, at full size and in the unit of the poses.

    ``captures`` is as in ``train_on_photographs``, but poses are never solved: that raises
    CaptureError.
    """
    folder, poses = _folder_and_poses(captures, None)
    if poses is None:
        raise CaptureError("there are no poses", where=captures, cure="Give a pose file, or its folder.")
    return import_captures(folder, poses, replace(CaptureSettings(), max_side_px=ANY_SIZE_PX)).captures


def _folder_and_poses(captures: Path, poses: Path | None) -> tuple[Path, Path | None]:
    """The folder of the photographs, and the poses given or found there."""
    if poses is not None:
        return captures, poses
    if captures.is_file():
        return captures.parent, captures
    found = poses_beside(captures) if captures.is_dir() else ()
    return captures, only_one(found, captures) if found else None


def _split(captures: Sequence[Capture], hold_out: int | None) -> tuple[tuple[Capture, ...], tuple[Capture, ...]]:
    """Training images and held-out ones: every ``hold_out``-th by name, beginning with the first."""
    if hold_out is None:
        return tuple(captures), ()
    ordered = sorted(captures, key=lambda capture: capture.name)
    held = tuple(ordered[::hold_out])
    return tuple(capture for k, capture in enumerate(ordered) if k % hold_out), held


def _observation(capture: Capture) -> Observation:
    """Of the capture's image, loaded when it is needed, and so its mask."""
    counted = None if capture.mask_path is None else partial(counted_pixels, capture)
    return Observation(capture.camera, capture.image, confidence=counted)


def _tell_masks(
    images: Sequence[Capture], held: Sequence[Capture], poses: Path | None, named: int, progress: Progress
) -> None:
    """Say which masks are used of those ``named``, and look at them all before the long work."""
    masked = [capture for capture in images if capture.mask_path is not None]
    for capture in masked:
        counted_pixels(capture)
    if masked:
        progress.message(f"masks of {len(masked)} images: what is black in them is not trained on")
    if any(capture.mask_path is not None for capture in held):
        progress.message("held-out views are scored whole: what their masks hide counts there", "warning")
    found = sum(capture.mask_path is not None for capture in (*images, *held))
    if found < named:
        progress.message(f"{named - found} of the {named} masks named in {poses} are missing", "warning")


def _outside_masks(sparse: SparsePoints, images: Sequence[Capture]) -> np.ndarray:
    """(P,) bool: the points that no image measured where its mask hides what is there."""
    kept = np.ones(len(sparse.points), bool)
    for index, capture in enumerate(images):
        if capture.mask_path is not None:
            counted = counted_pixels(capture)
            rows = sparse.visibility[:, index]
            column, line = np.floor(sparse.pixels[rows, index]).astype(int).T
            height, width = counted.shape
            kept[rows] &= counted[line.clip(0, height - 1), column.clip(0, width - 1)] > 0
    return kept


def _views_of(frozen: Path) -> tuple[Capture, ...]:
    """The held-out views of a cameras.json, or those of a transforms.json, which may be all."""
    if "frames" not in json_fields.read_json(frozen):
        return load_frozen_views(frozen)
    photographs, _ = read_transforms_json(frozen, frozen.parent, held_out=True)
    require_once_each(photographs)
    return posed_captures(photographs, ANY_SIZE_PX)


def _first_points(
    images: Sequence[Capture], poses: Path | None, settings: Settings, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (P, 3) float64 in the frame of the poses, and colours (P, 3) uint8, where none were given."""
    if poses is not None:
        record, place = find_poses(poses)
        found = record.points(place, progress) if record.points else None
        if found is not None:
            progress.message(f"{len(found[0])} points of the {record.name}")
            return found
    sparse = triangulate(images, settings.captures, progress)
    kept = _outside_masks(sparse, images)
    return sparse.points[kept], sparse.colours[kept]


def _unit_m(imported: Imported, images: Sequence[Capture], xyz: np.ndarray, progress: Progress) -> float:
    """Metres of the poses' unit; assumed where they are not metric. Some point must be in view."""
    depths = []
    for capture in images:
        pixels, depth = capture.camera.project(xyz)
        depths.append(depth[capture.camera.sees(pixels, depth)])
    seen = np.concatenate(depths)
    if not len(seen):
        raise CaptureError("no image sees a point", where="points", cure="Give points in the frame of the poses.")
    if imported.metric:
        return 1.0
    progress.message("the poses' unit is unknown: lengths are taken for those of a room while training")
    return float(_MEDIAN_DEPTH_M / np.median(seen))
