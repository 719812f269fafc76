"""A splat asset straight from photographs, without a scene: what ``r2sego train`` does.

Photographs are imported, points triangulated or read, Gaussians put on them and trained.
The asset stays in the frame and unit of the poses.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .captures import json_fields
from .captures.capture import Capture
from .captures.colmap_model import COLMAP_FILES, find_model
from .captures.colmap_points import read_colmap_points
from .captures.frozen import load_frozen_views
from .captures.importing import Imported, import_captures
from .captures.photographs import ANY_SIZE_PX, capture_of
from .captures.polycam import find_keyframes
from .captures.sparse import triangulate
from .captures.transforms_json import read_transforms_json
from .errors import AssetError, CaptureError, SettingsError
from .named_settings import with_overrides
from .progress import SILENT, Progress
from .resources import cpu_s, peak_memory_mb
from .settings import Settings
from .splats.asset import SplatAsset
from .splats.formats import SUFFIXES, save_asset
from .splats.initialization import from_points
from .splats.metrics import psnr
from .splats.observations import Observation
from .splats.packing import PackedGaussians
from .splats.rasterizer import Rasterizer, render
from .splats.training import Watch, train

_SECTIONS = ("captures", "training")
_POSE_FILES = ("cameras.json", "transforms.json", "transforms_train.json")
_FEWEST_IMAGES = 2

_MEDIAN_DEPTH_M = 3.0
"""Where the poses' unit is unknown, the median point is taken to be this far away, as in a room:
sizes of Gaussians and the nearest distance drawn are metres."""

_GREY = 128

_TIMES_TOLD, _LEAST_BETWEEN_S, _VIEWS_TOLD = 10, 5.0, 4
"""How often a training says how far it has come, and on how many views."""


@dataclass(frozen=True)
class HeldOut:
    """Mean scores on views that training did not see: PSNR in dB, SSIM, and their number."""

    psnr: float
    ssim: float
    views: int


@dataclass(frozen=True)
class Trained:
    """An asset's file, in the frame of the poses, and what it took.

    ``cpu_s`` are processor seconds of all threads and child processes, from import to the
    written file; ``peak_rss_mb`` is the most memory of this process, None where unknown.
    Scoring is in neither.
    """

    path: Path
    gaussians: int
    images: int
    source: str
    cpu_s: float
    peak_rss_mb: float | None
    held_out: HeldOut | None

    def to_json(self) -> dict[str, Any]:
        """The figures, JSON-ready."""
        figures = dataclasses.asdict(self)
        return {"asset": str(figures.pop("path")), **figures}

    def line(self) -> str:
        """The figures for a person."""
        held, peak = self.held_out, self.peak_rss_mb
        scored = ""
        if held is not None:
            views = "1 held-out view" if held.views == 1 else f"{held.views} held-out views"
            scored = f", PSNR {held.psnr:.2f} dB and SSIM {held.ssim:.3f} on {views}"
        memory = "" if peak is None else f", at most {peak:.0f} MB"
        return (
            f"{self.path}: {self.gaussians} Gaussians from {self.images} images{scored}; "
            f"{self.cpu_s:.1f} CPU-seconds{memory}"
        )


def settings_of(overrides: Mapping[str, Any]) -> Settings:
    """Settings with ``overrides``. Raises SettingsError for those that do nothing here."""
    for key in overrides:
        section = key.rpartition(".")[0]
        if section not in _SECTIONS and key != "seed":
            raise SettingsError(
                f"'{key}' does nothing here", where="r2sego train",
                cure=f"Give {', '.join(f'{name}.*' for name in _SECTIONS)} or seed.",
            )  # fmt: skip
    return with_overrides(overrides)


def train_on_photographs(
    captures: Path,
    out: Path,
    *,
    poses: Path | None = None,
    points: Path | None = None,
    frozen: Path | None = None,
    hold_out: int | None = None,
    settings: Settings = Settings(),
    progress: Progress = SILENT,
) -> Trained:
    """Train an asset on ``captures`` and write it to ``out``, in the format of its suffix.

    ``captures`` is a folder of photographs, or a pose file beside them; without ``poses`` a
    cameras.json, transforms.json, transforms_train.json or COLMAP model in the folder is
    taken, else poses are solved. Gaussians start on the vertices of the PLY ``points``, else
    on the points of the COLMAP model or the transforms.json, else on points triangulated from
    the training images. Scores are made on the views of ``frozen``, a cameras.json with such a
    list or a transforms.json, in the frame of the poses, or on every ``hold_out``-th image by
    name, which is then not trained on.

    What can be wrong is looked at before the long work. Raises AssetError for ``out``,
    SettingsError for options that do not fit, CaptureError for photographs, poses and points.
    """
    started_s = cpu_s()
    check_output(out)
    start = prepare(captures, poses, points, frozen, hold_out, settings, progress)
    rng = np.random.default_rng(settings.seed)
    steps = settings.training.steps_per_round
    asset = train(
        start.asset(settings, rng), start.observations, steps, settings.training, rng, progress,
        watch=_telling(start, steps, progress),
    )  # fmt: skip
    save_asset(out, asset.transformed(np.linalg.inv(start.metres_from_poses)))
    taken_s, peak_mb = cpu_s() - started_s, peak_memory_mb()
    scores = _scores(asset, start.held_out, progress) if start.held_out else None
    return Trained(out, len(asset), len(start.observations), start.source, taken_s, peak_mb, scores)


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
    folder, poses = _folder_and_poses(captures, poses)
    imported = import_captures(folder, poses, settings.captures, progress)
    images, held = _split(imported.captures, hold_out)
    if frozen is not None:
        held = _views_of(frozen)
    if len(images) < _FEWEST_IMAGES:
        raise CaptureError(
            f"{len(images)} image{'s are' if len(images) != 1 else ' is'} left to train on",
            where=folder,
            cure="Hold out fewer, or add photographs.",
        )
    side_px, limit_px = max(max(c.camera.shape) for c in images), settings.captures.max_side_px
    limit = ", as captures.max_side_px says" if side_px == limit_px else ""
    progress.message(
        f"{len(images)} images to train on, up to {side_px} pixels a side{limit}: {imported.source}"
    )
    if any("mask_path" in frame for frame in _transforms(poses).get("frames", ())):
        progress.message("masks are not read: what they hide is trained on too", level="warning")
    xyz, colours = _first_points(images, poses, points, settings, progress)
    unit_m = _unit_m(imported, images, xyz, progress)
    to_metres = np.diag([unit_m, unit_m, unit_m, 1.0])
    return Start(
        observations=tuple(Observation(c.camera.transformed(to_metres), c.image) for c in images),
        held_out=tuple(view.transformed(to_metres) for view in held),
        points=xyz * unit_m,
        colours=colours,
        metres_from_poses=to_metres,
        source=imported.source,
    )


def check_output(path: Path) -> None:
    """Raise AssetError when an asset cannot be written to ``path``: its suffix or its folder."""
    if path.suffix.lower() not in SUFFIXES:
        raise AssetError(
            f"'{path.suffix}' is no format of splats", where=path, cure=f"Use one of {', '.join(SUFFIXES)}."
        )
    if not path.parent.is_dir():
        raise AssetError("there is no such folder", where=path.parent, cure="Make it first.")
    if path.is_dir():
        raise AssetError("a folder has this name", where=path, cure="Give a file.")


def _folder_and_poses(captures: Path, poses: Path | None) -> tuple[Path, Path | None]:
    """The folder of the photographs, and the poses given or found there: a file, or a model's folder."""
    if poses is None and captures.is_file():
        captures, poses = captures.parent, captures
    elif poses is None and captures.is_dir():
        file = next((captures / name for name in _POSE_FILES if (captures / name).is_file()), None)
        poses = find_model(captures) if file is None else file
    if poses is None:
        return captures, None
    if poses.name in COLMAP_FILES:
        return captures, poses.parent
    listed = poses / "transforms.json"
    if listed.is_file() and not (find_model(poses) or find_keyframes(poses)):
        return captures, listed
    return captures, poses


def _split(
    captures: Sequence[Capture], hold_out: int | None
) -> tuple[tuple[Capture, ...], tuple[Capture, ...]]:
    """Training images and held-out ones: every ``hold_out``-th by name, beginning with the first."""
    if hold_out is None:
        return tuple(captures), ()
    if hold_out < 2:
        raise SettingsError(
            f"every {hold_out}th image leaves none", where="--hold-out", cure="Give 2 at least; 8 is usual."
        )
    ordered = sorted(captures, key=lambda capture: capture.name)
    held = tuple(ordered[::hold_out])
    return tuple(capture for k, capture in enumerate(ordered) if k % hold_out), held


def _views_of(frozen: Path) -> tuple[Capture, ...]:
    """The held-out views of a cameras.json, or all those of a transforms.json."""
    if "frames" not in json_fields.read_json(frozen):
        return load_frozen_views(frozen)
    photographs, _ = read_transforms_json(frozen, frozen.parent)
    return tuple(capture_of(photograph, ANY_SIZE_PX) for photograph in photographs)


def _first_points(
    images: Sequence[Capture], poses: Path | None, points: Path | None, settings: Settings, progress: Progress
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (P, 3) float64 in the frame of the poses, and colours (P, 3) uint8."""
    if points is not None:
        return read_ply_points(points)
    model = find_model(poses) if poses is not None and poses.is_dir() else None
    if model is not None:
        found, whose = read_colmap_points(model), "COLMAP model"
    else:
        found, whose = _points_beside(poses, progress), "transforms.json"
    if found is not None:
        progress.message(f"{len(found[0])} points of the {whose}")
        return found
    sparse = triangulate(images, settings.captures, progress)
    return sparse.points, sparse.colours


def _transforms(poses: Path | None) -> dict[str, Any]:
    """What a transforms.json says; empty for other poses."""
    data = json_fields.read_json(poses) if poses is not None and poses.is_file() else {}
    return data if "frames" in data else {}


def _points_beside(poses: Path | None, progress: Progress) -> tuple[np.ndarray, np.ndarray] | None:
    """The points that nerfstudio puts beside a transforms.json, in the frame of its poses."""
    name = _transforms(poses).get("ply_file_path")
    if not isinstance(name, str):
        return None
    if (poses.parent / name).is_file():
        return read_ply_points(poses.parent / name)
    progress.message(f"the points '{name}' of {poses} are missing", level="warning")
    return None


def read_ply_points(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (P, 3) float64 of a PLY and their colours (P, 3) uint8, grey where it has none.

    Raises CaptureError when the file is missing or holds no point.
    """
    import trimesh

    try:
        cloud = trimesh.load(path, file_type="ply", process=False)
        xyz = np.asarray(cloud.vertices, np.float64).reshape(-1, 3)
    except Exception as error:  # trimesh raises whatever its parser ran into
        raise CaptureError(
            "the points cannot be read", where=path, cure="Give a PLY file with vertices."
        ) from error
    colours = getattr(cloud, "colors", None) if isinstance(cloud, trimesh.PointCloud) else None
    if colours is None and cloud.visual.kind == "vertex":
        colours = cloud.visual.vertex_colors
    if colours is None or len(colours) != len(xyz):
        colours = np.full((len(xyz), 3), _GREY)
    return _finite(xyz, np.asarray(colours, np.uint8)[:, :3], path)


def _finite(xyz: np.ndarray, colours: np.ndarray, path: Path) -> tuple[np.ndarray, np.ndarray]:
    kept = np.isfinite(xyz).all(axis=1)
    if not kept.any():
        raise CaptureError("there is no point in the file", where=path, cure="Give one with points.")
    return xyz[kept], colours[kept]


def _unit_m(imported: Imported, images: Sequence[Capture], xyz: np.ndarray, progress: Progress) -> float:
    """Metres of the poses' unit; assumed where they are not metric. Some point must be in view."""
    depths = []
    for capture in images:
        pixels, depth = capture.camera.project(xyz)
        depths.append(depth[capture.camera.sees(pixels, depth)])
    seen = np.concatenate(depths)
    if not len(seen):
        raise CaptureError(
            "no image sees a point", where="points", cure="Give points in the frame of the poses."
        )
    if imported.metric:
        return 1.0
    progress.message("the poses' unit is unknown: lengths are taken for those of a room while training")
    return float(_MEDIAN_DEPTH_M / np.median(seen))


def _telling(start: Start, steps: int, progress: Progress) -> Watch:
    """A ``watch`` of ``train`` that tells now and then how many Gaussians there are, and how good."""
    views = [(view.camera, view.image) for view in start.held_out]
    kind = "held-out" if views else "training"
    views = views or [(view.camera, view.loaded) for view in start.observations]
    views = views[:: -(-len(views) // _VIEWS_TOLD)]
    rasterizer, told_s = Rasterizer(), time.monotonic()

    def watch(step: int, gaussians: PackedGaussians) -> bool:
        nonlocal told_s
        due = step % max(1, steps // _TIMES_TOLD) == 0 and step < steps
        if due and time.monotonic() - told_s > _LEAST_BETWEEN_S:
            found_db = []
            for camera, image in views:
                rasterizer.forward(gaussians, camera)
                found_db.append(psnr(np.clip(rasterizer.colour, 0.0, 1.0), image()))
            progress.message(
                f"step {step} of {steps}: {len(gaussians)} Gaussians, "
                f"PSNR {np.mean(found_db):.1f} dB on {len(views)} {kind} views"
            )
            told_s = time.monotonic()
        return False

    return watch


def _scores(asset: SplatAsset, views: Sequence[Capture], progress: Progress) -> HeldOut:
    """As ``r2sego evaluate`` scores."""
    from .evaluation.frozen import score

    found = score(
        lambda camera: render(asset, camera).colour, views, progress=progress, title="Scoring held-out views"
    )
    return HeldOut(found.psnr, found.ssim, len(views))
