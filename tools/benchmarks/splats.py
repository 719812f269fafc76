"""How long rendering and one training step of splats take here, and how long they must.

Times are the processor's, of all threads together; wall-clock times stand beside them. The
floor is what an ideal program would need for the same pairs, samples and bytes at the peak
rates this machine was measured to have.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np

from r2sego_blender.commands.bench_defaults import SIZE, SPLATS_GAUSSIANS, SPLATS_REPEATS
from r2sego_blender.config.training_settings import TrainingSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.progress import SILENT, Progress, Task
from r2sego_blender.core.resources import forget_peak_memory, peak_memory_mb, processor
from r2sego_blender.splats.kernels.adam import AdamState
from r2sego_blender.splats.kernels.loss import PhotometricLoss
from r2sego_blender.splats.kernels.packing import PackedGaussians, rows_of
from r2sego_blender.splats.kernels.tiles import planes_of
from r2sego_blender.splats.rendering.rasterizer import Rasterizer
from r2sego_blender.splats.vector_language.vectors import LANES

from .machine import bandwidth_bytes_per_s, fma_rate_per_s, isa
from .pairs import Work, count_work
from .workloads import Workload, made_up_room, of_files, parse_size

_WARM_UP = 2

_PARTS = ("forward", "loss", "backward")
_BLACK = (0.0, 0.0, 0.0)
_CHANNELS = 3

_PAIR_INSTRUCTIONS = 50
"""Least vector instructions for sixteen contributing pairs, 18 forward and 32 backward:
the quadratic form by forward differences along a row, exp2 by a polynomial, front-to-back
compositing and its gradient, every lane in use."""

_SAMPLE_INSTRUCTIONS = 204
"""Least for sixteen samples of the loss: seven separable blurs of 11 + 11 taps, 50 for the formulas."""

_PARAMETER_PASSES = 7
"""A parameter is read for the projection; it and its two moments are read and written for the step."""

_PLANE_PASSES = 20
"""Image planes passed: 4 written by the forward, 6 read and 3 written by the loss, 7 read by the backward."""

_FLOAT_BYTES = 4


def bench_splats(
    gaussians: int | None = None,
    asset: Path | None = None,
    cameras: Path | None = None,
    size: str | None = None,
    threads: int | None = None,
    repeats: int = SPLATS_REPEATS,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Measure on a made-up room of ``gaussians``, or on an ``asset`` seen by ``cameras``.

    ``size`` is ``WxH`` (default: 640x480, or the views' own); ``threads`` default to all.
    Returns JSON-ready figures, docs/splats.md says what each means. Raises SettingsError for
    options that do not fit together, AssetError and CaptureError for the files.
    """
    if (asset is None) != (cameras is None) or (asset is not None and gaussians is not None):
        raise SettingsError(
            "the options do not fit together",
            where="r2sego bench splats",
            cure="Give --asset with --cameras, or --gaussians, or none of them.",
        )
    gaussians = SPLATS_GAUSSIANS if gaussians is None else gaussians
    for option, value in (("--gaussians", gaussians), ("--repeats", repeats)):
        if value < 1:
            raise SettingsError(f"{value} is too few", where=option, cure="Give 1 at least.")
    before = numba.get_num_threads()
    with_threads = before if threads is None else threads
    if not 1 <= with_threads <= numba.config.NUMBA_NUM_THREADS:
        raise SettingsError(
            f"{with_threads} threads cannot be had",
            where="--threads",
            cure=f"This machine, or NUMBA_NUM_THREADS, gives 1 to {numba.config.NUMBA_NUM_THREADS}.",
        )
    if asset is None or cameras is None:
        workload = made_up_room(gaussians, parse_size(size or SIZE))
    else:
        workload = of_files(asset, cameras, None if size is None else parse_size(size))
    numba.set_num_threads(with_threads)
    try:
        return measure(workload, repeats, progress)
    finally:
        numba.set_num_threads(before)


def measure(workload: Workload, repeats: int, progress: Progress = SILENT) -> dict[str, Any]:
    """The figures of a workload with as many threads as Numba is set to."""
    steps = _Steps(workload)
    passes = len(workload.views)
    with progress.task("Benchmark of the splats", (_WARM_UP + repeats) * passes) as task:
        for _ in range(_WARM_UP):
            steps.run(task)
        forget_peak_memory()
        times_s = np.array([steps.run(task) for _ in range(repeats)])
        peak_mb = peak_memory_mb()  # before the arrays of what follows
    works = steps.counted()
    figures: dict[str, Any] = {
        "machine": processor(),
        "isa": isa(),
        "threads": numba.get_num_threads(),
        "source": workload.source,
        "gaussians": len(workload.asset),
        "size": _sizes(workload),
        "views": passes,
        "visible": _mean([work.visible for work in works]),
        "contributing": _mean([work.contributing for work in works]),
        "pairs": _mean([work.pairs for work in works]),
        "repeats": repeats,
    }
    figures |= _times(times_s)
    rates = Rates(fma_rate_per_s(), bandwidth_bytes_per_s())
    floors = [
        floor_ms(work, view.camera, rows_of(workload.asset.sh.shape[1]), rates)
        for work, view in zip(works, workload.views, strict=True)
    ]
    figures |= {name: _mean([floor[name] for floor in floors]) for name in floors[0]}
    return figures | {
        "step_over_floor": figures["step_cpu_ms"] / figures["floor_cpu_ms"],
        "pairs_per_s": figures["pairs"] / figures["forward_cpu_ms"] * 1e3,
        "peak_rss_mb": peak_mb,
        "fma_rate_per_s": rates.fma_per_s,
        "bandwidth_bytes_per_s": rates.bytes_per_s,
    }


@dataclass(frozen=True)
class Rates:
    """Peaks of one thread: multiply-adds of sixteen lanes, and bytes, a second."""

    fma_per_s: float
    bytes_per_s: float


def floor_ms(work: Work, camera: Camera, rows: int, rates: Rates) -> dict[str, float]:
    """Least processor time of a training step, ms, whole and in its parts.

    ``rows`` are the parameters of a Gaussian.
    """
    pixels = camera.width * camera.height
    touched = work.contributing * rows * _PARAMETER_PASSES + pixels * _PLANE_PASSES
    seconds = {
        "floor_raster_cpu_ms": work.pairs / LANES * _PAIR_INSTRUCTIONS / rates.fma_per_s,
        "floor_loss_cpu_ms": pixels * _CHANNELS / LANES * _SAMPLE_INSTRUCTIONS / rates.fma_per_s,
        "floor_traffic_cpu_ms": touched * _FLOAT_BYTES / rates.bytes_per_s,
    }
    return {name: 1e3 * value for name, value in {"floor_cpu_ms": sum(seconds.values()), **seconds}.items()}


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    threads = f"{f['threads']} thread{'s' if f['threads'] > 1 else ''}"
    peaks = f"{f['fma_rate_per_s'] / 1e9:.2f} G vector FMA/s, {f['bandwidth_bytes_per_s'] / 1e9:.1f} GB/s"
    seen = f"{f['visible']:.0f} visible, {f['contributing']:.0f} contribute {f['pairs'] / 1e6:.2f} M pairs"
    text = [
        f"{f['machine']}, {f['isa']}, {threads}: {peaks}",
        f"{f['source']}: {f['gaussians']} Gaussians at {f['size']}, {seen}",
        "",
        f"{'ms an image':<12}{'CPU median':>12}{'CPU min':>10}{'wall median':>13}{'wall min':>10}",
    ]
    for part in (*_PARTS, "step"):
        cells = [f[f"{part}_{clock}_ms{end}"] for clock in ("cpu", "wall") for end in ("", "_min")]
        text.append(f"{part:<12}{cells[0]:>12.2f}{cells[1]:>10.2f}{cells[2]:>13.2f}{cells[3]:>10.2f}")
    parts = ", ".join(f"{part} {f[f'floor_{part}_cpu_ms']:.2f}" for part in ("raster", "loss", "traffic"))
    text.append(f"{'floor':<12}{f['floor_cpu_ms']:>12.2f}  ({parts})")
    peak = "unknown" if f["peak_rss_mb"] is None else f"{f['peak_rss_mb']:.0f} MB"
    text.append(
        f"a step takes {f['step_over_floor']:.1f} times the floor; forward {f['pairs_per_s'] / 1e6:.0f} M "
        f"pairs/s; peak memory {peak}"
    )
    return text


class _Steps:
    """Training steps on all views, on buffers that are kept, as in training.

    The learning rates are 0: all is computed, and nothing moves, so that every repeat does
    the same work.
    """

    def __init__(self, workload: Workload) -> None:
        self._cameras = [view.camera for view in workload.views]
        self._targets = [planes_of(view.image()) for view in workload.views]
        self._gaussians = PackedGaussians.of(workload.asset)
        self._degree = workload.asset.degree
        self._adam = AdamState.of(self._gaussians)
        self._rates = np.zeros(rows_of(self._gaussians.coefficients), np.float32)
        self._rasterizer = Rasterizer()
        self._losses = {camera.shape: PhotometricLoss(*camera.shape) for camera in self._cameras}

    def run(self, task: Task) -> np.ndarray:
        """Seconds (3, 2) of forward, loss and backward with Adam, CPU and wall: means over the views."""
        total_s = np.zeros((len(_PARTS), 2))
        for camera, target in zip(self._cameras, self._targets, strict=True):
            total_s += np.diff(self._step(camera, target), axis=0)
            task.advance()
        return total_s / len(self._cameras)

    def counted(self) -> list[Work]:
        """What each view has to do."""
        works = []
        for camera in self._cameras:
            self._rasterizer.forward(self._gaussians, camera, _BLACK, self._degree, with_depth=False)
            works.append(count_work(self._rasterizer.tile_entries, camera.shape))
        return works

    def _step(self, camera: Camera, target: np.ndarray) -> list[tuple[float, float]]:
        """The clocks before, between and after the parts."""
        rasterizer, loss = self._rasterizer, self._losses[camera.shape]
        clocks = [_clocks()]
        rasterizer.forward(self._gaussians, camera, _BLACK, self._degree, with_depth=False)
        clocks.append(_clocks())
        loss(rasterizer.planes, target, TrainingSettings.ssim_weight, rasterizer.gradient_planes)
        clocks.append(_clocks())
        rasterizer.step(self._adam, self._rates)
        clocks.append(_clocks())
        return clocks


def _clocks() -> tuple[float, float]:
    return time.process_time(), time.perf_counter()


def _times(times_s: np.ndarray) -> dict[str, float]:
    """Median and least over the repeats (R, 3, 2), ms, of each part and of the whole step."""
    whole = np.concatenate([times_s, times_s.sum(axis=1, keepdims=True)], axis=1) * 1e3
    figures = {}
    for k, part in enumerate((*_PARTS, "step")):
        for column, clock in enumerate(("cpu", "wall")):
            figures[f"{part}_{clock}_ms"] = float(np.median(whole[:, k, column]))
            figures[f"{part}_{clock}_ms_min"] = float(whole[:, k, column].min())
    return figures


def _sizes(workload: Workload) -> str:
    """The sizes of the views, each once, as ``WxH``."""
    return ", ".join(sorted({f"{view.camera.width}x{view.camera.height}" for view in workload.views}))


def _mean(values: list[float]) -> float:
    return float(np.mean(values))
