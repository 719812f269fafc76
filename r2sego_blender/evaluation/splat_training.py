"""A splat asset straight from photographs, without a scene: what ``r2sego train`` does.

Photographs are imported, points triangulated or read, Gaussians put on them and trained.
The asset stays in the frame and unit of the poses.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..captures.capture import Capture
from ..config.presets import with_overrides
from ..config.settings import Settings
from ..core.atomic_files import unwritable
from ..core.errors import AssetError, SettingsError
from ..core.progress import SILENT, Progress
from ..core.resources import cpu_s, peak_memory_mb
from ..refine.splat_start import Start, prepare
from ..splats.asset import SplatAsset
from ..splats.backends.slot import require_backend
from ..splats.formats.registry import format_of, save_asset
from ..splats.kernels.packing import PackedGaussians
from ..splats.metrics import psnr
from ..splats.rendering.rasterizer import Rasterizer, render
from ..splats.training.training import Watch, train

_SECTIONS = ("captures", "training")

_TIMES_TOLD, _LEAST_BETWEEN_S, _VIEWS_TOLD = 10, 5.0, 4
"""How often a training says how far it has come, and on how many views."""
_LEAST_KEPT_S = 60.0
"""A shorter training is sooner done again than its parts are looked for."""


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
    The scores at the end are in neither.
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
            views = _views(held.views, "held-out")
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
                f"'{key}' does nothing here",
                where="r2sego train",
                cure=f"Give {', '.join(f'{name}.*' for name in _SECTIONS)} or seed.",
            )
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

    What can be wrong is looked at before the long work, and of a long training ten states are
    kept, each in place of the last, in ``unfinished_file``. Raises AssetError for ``out``,
    SettingsError for options that do not fit, CaptureError for photographs, poses and points.
    """
    started_s = cpu_s()
    check_output(out)
    require_backend(settings.training.backend)
    start = prepare(captures, poses, points, frozen, hold_out, settings, progress)
    rng = np.random.default_rng(settings.seed)
    steps = settings.training.steps_per_round
    asset = train(
        start.asset(settings, rng),
        start.observations,
        steps,
        settings.training,
        rng,
        progress,
        watch=_telling(start, steps, unfinished_file(out), progress),
    )
    save_asset(out, start.in_poses(asset))
    unfinished_file(out).unlink(missing_ok=True)
    taken_s, peak_mb = cpu_s() - started_s, peak_memory_mb()
    scores = _scores(asset, start.held_out, progress) if start.held_out else None
    return Trained(out, len(asset), len(start.observations), start.source, taken_s, peak_mb, scores)


def unfinished_file(out: Path) -> Path:
    """Where a training to ``out`` that is under way, or was cancelled, has its last kept state."""
    return out.with_name(f"{out.stem}.unfinished{out.suffix}")


def check_output(path: Path) -> None:
    """Raise AssetError when an asset cannot be written to ``path``: its suffix or folder is none, or takes no file."""
    format_of(path)
    if not path.parent.is_dir():
        raise AssetError("there is no such folder", where=path.parent, cure="Make it first.")
    if path.is_dir():
        raise AssetError("a folder has this name", where=path, cure="Give a file.")
    if reason := unwritable(path.parent):
        cure = "Choose a folder that can be written."
        raise AssetError(f"no file can be made there: {reason}", where=path.parent, cure=cure)


def _telling(start: Start, steps: int, kept: Path, progress: Progress) -> Watch:
    """A ``watch`` of ``train`` that tells now and then how far it has come, and keeps that in ``kept``."""
    views = [(view.camera, view.image) for view in start.held_out]
    kind = "held-out" if views else "training"
    views = views or [(view.camera, view.loaded) for view in start.observations]
    views = views[:: -(-len(views) // _VIEWS_TOLD)]
    rasterizer = Rasterizer()
    told_s = kept_s = time.monotonic()

    def watch(step: int, now: Callable[[], PackedGaussians]) -> bool:
        nonlocal told_s, kept_s
        now_s = time.monotonic()
        if step == steps or step % max(1, steps // _TIMES_TOLD) or now_s - told_s <= _LEAST_BETWEEN_S:
            return False
        found_db, gaussians = [], now()
        for camera, image in views:
            rasterizer.forward(gaussians, camera)
            found_db.append(psnr(np.clip(rasterizer.colour, 0.0, 1.0), image()))
        where = ""
        if now_s - kept_s > _LEAST_KEPT_S:
            save_asset(kept, start.in_poses(gaussians.asset()))
            where, kept_s = f", kept in {kept.name}", now_s
        progress.message(
            f"step {step} of {steps}: {len(gaussians)} Gaussians, "
            f"PSNR {np.mean(found_db):.1f} dB on {_views(len(views), kind)}{where}"
        )
        told_s = now_s
        return False

    return watch


def _views(count: int, kind: str) -> str:
    return f"{count} {kind} view{'s' if count != 1 else ''}"


def _scores(asset: SplatAsset, views: Sequence[Capture], progress: Progress) -> HeldOut:
    """As ``r2sego evaluate`` scores."""
    from .frozen import score

    found = score(lambda camera: render(asset, camera).colour, views, progress=progress, title="Scoring held-out views")
    return HeldOut(found.psnr, found.ssim, len(views))
