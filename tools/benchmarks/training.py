"""How much sooner training reaches the quality of plain training: the same photographs, twice.

Plain training has its final number of Gaussians from the start and looks at every pixel in each
step; the other is what ``r2sego train`` does. Both start with the same Gaussians and have the
same learning rates. Held-out views are scored as training goes on, which is not counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from r2sego_blender.commands.bench_defaults import TRAINING_GAUSSIANS, TRAINING_HOLD_OUT, TRAINING_STEPS
from r2sego_blender.config.presets import EVERY_PIXEL, MANY_PHOTOGRAPHS, with_overrides
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb
from r2sego_blender.refine.splat_start import Start, prepare
from r2sego_blender.splats.kernels.packing import PackedGaussians
from r2sego_blender.splats.metrics import psnr
from r2sego_blender.splats.rendering.rasterizer import Rasterizer
from r2sego_blender.splats.training.initialization import from_points
from r2sego_blender.splats.training.training import train

_PLAIN: Mapping[str, Any] = {**MANY_PHOTOGRAPHS, **EVERY_PIXEL, "densification": "none"}
_LOOKS = 30
"""Times the held-out views are scored in a run."""

_GROWTH = 1.5
"""The other training may end with this many times the Gaussians of the plain one."""


@dataclass
class _Run:
    """The curve of one training: steps, CPU-seconds, PSNR in dB and Gaussians at each look."""

    start: Start
    stop_psnr: float
    every: int
    curve: list[tuple[int, float, float, int]] = field(default_factory=list)
    _rasterizer: Rasterizer = field(default_factory=Rasterizer)
    _spent_s: float = 0.0
    _since_s: float = field(default_factory=time.process_time)

    def watch(self, step: int, now: Callable[[], PackedGaussians]) -> bool:
        """Score now and then; True when the quality looked for is reached."""
        if step % self.every:
            return False
        self._spent_s += time.process_time() - self._since_s
        scores, gaussians = [], now()
        for view in self.start.held_out:
            self._rasterizer.forward(gaussians, view.camera, with_depth=False)
            scores.append(psnr(np.clip(self._rasterizer.colour, 0.0, 1.0), view.image()))
        self.curve.append((step, round(self._spent_s, 2), float(np.mean(scores)), len(gaussians)))
        self._since_s = time.process_time()
        return self.curve[-1][2] >= self.stop_psnr


def bench_training(
    captures: Path,
    poses: Path | None = None,
    points: Path | None = None,
    hold_out: int = TRAINING_HOLD_OUT,
    gaussians: int = TRAINING_GAUSSIANS,
    steps: int = TRAINING_STEPS,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Train on ``captures`` plainly for ``steps``, then as usual until the same held-out PSNR.

    Every ``hold_out``-th image is held out. Returns both curves and ``cpu_ratio``, the
    CPU-seconds of the second over those of the first, None when it did not get there. Errors
    as for ``train_on_photographs``.
    """
    if gaussians < 1 or steps < _LOOKS:
        raise SettingsError(
            f"{gaussians} Gaussians in {steps} steps show nothing",
            where="r2sego bench training",
            cure=f"Give at least {_LOOKS} steps.",
        )
    start = prepare(captures, poses, points, None, hold_out, with_overrides({}), progress)
    _warm_up(start)
    plain = _curve(start, _PLAIN, gaussians, gaussians, steps, np.inf, "Plain training", progress)
    usual = _curve(
        start, MANY_PHOTOGRAPHS, gaussians, int(_GROWTH * gaussians), steps, plain["psnr"], "Training", progress
    )
    reached = usual["psnr"] >= plain["psnr"]
    return {
        "source": str(captures),
        "images": len(start.observations),
        "held_out": len(start.held_out),
        "plain": plain,
        "usual": usual,
        "cpu_ratio": usual["cpu_s"] / plain["cpu_s"] if reached else None,
    }


def _curve(
    start: Start,
    changes: Mapping[str, Any],
    first: int,
    most: int,
    steps: int,
    stop_psnr: float,
    title: str,
    progress: Progress,
) -> dict[str, Any]:
    overrides = {f"training.{key}": value for key, value in changes.items()}
    settings = with_overrides({**overrides, "training.max_gaussians": most})
    rng = np.random.default_rng(settings.seed)
    chosen = rng.permutation(len(start.points))[:first]
    asset = from_points(start.points[chosen], start.colours[chosen], settings.training, rng)
    forget_peak_memory()
    run = _Run(start, stop_psnr, max(1, steps // _LOOKS))
    train(asset, start.observations, steps, settings.training, rng, progress, title, run.watch)
    last = run.curve[-1]
    return {
        "steps": last[0],
        "cpu_s": last[1],
        "psnr": last[2],
        "gaussians": last[3],
        "peak_rss_mb": peak_memory_mb(),
        "curve": run.curve,
    }


def _warm_up(start: Start) -> None:
    """Compile the kernels, which is not training."""
    settings = with_overrides({}).training
    rng = np.random.default_rng(0)
    asset = from_points(start.points[:1000], start.colours[:1000], settings, rng)
    train(asset, start.observations[:1], 2, settings, rng)


def lines(figures: Mapping[str, Any]) -> list[str]:
    """The figures for a person."""
    told = []
    for name in ("plain", "usual"):
        run = figures[name]
        told.append(
            f"{name:<6} {run['psnr']:6.2f} dB after {run['steps']} steps, {run['cpu_s']:.1f} CPU-seconds, "
            f"{run['gaussians']} Gaussians, at most {run['peak_rss_mb'] or 0:.0f} MB"
        )
    ratio = figures["cpu_ratio"]
    told.append("the plain quality was not reached" if ratio is None else f"ratio {ratio:.2f}")
    return told
