"""How fast the z-buffer renders structural conditions here, and what each pass and file costs."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from r2sego_blender.captures.capture import Capture
from r2sego_blender.commands.bench_defaults import CONDITIONS_REPEATS, CONDITIONS_TRIANGLES, SIZE
from r2sego_blender.config.settings import GenerationSettings
from r2sego_blender.core.cameras import Camera
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.images import save_image
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.generation.conditions.condition_files import save_conditions
from r2sego_blender.generation.conditions.conditions import ZBufferRenderer
from r2sego_blender.generation.conditions.point_condition import PointConditions

from .workloads import made_up_path, made_up_proxy, made_up_room, parse_size

FRAMES = 25

_CAPTURES = 6
_WAVE_PX = 7.0  # of the made-up photographs' pattern


def bench_conditions(
    triangles: int = CONDITIONS_TRIANGLES,
    size: str = SIZE,
    repeats: int = CONDITIONS_REPEATS,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Render a clip's conditions of a made-up room of about ``triangles`` at ``size`` (``WxH``).

    Every figure is the least of ``repeats`` turns through the clip, for one frame, by the clock and
    by the processor's time of all threads; what else runs slows the former more. Returns
    JSON-ready figures, docs/conditions.md says what each means. Raises SettingsError for
    options that cannot be.
    """
    for option, value in (("--triangles", triangles), ("--repeats", repeats)):
        if value < 1:
            raise SettingsError(f"{value} is too few", where=option, cure="Give 1 at least.")
    lens = made_up_room(0, parse_size(size)).views[0].camera
    proxy = made_up_proxy(triangles)
    renderer, path = ZBufferRenderer(proxy), made_up_path(lens, FRAMES)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    with tempfile.TemporaryDirectory(prefix="r2sego-conditions-") as temporary:
        folder = Path(temporary)
        captures = _captures(folder, lens)
        points = PointConditions(captures, [renderer.depth(c.camera) for c in captures], GenerationSettings())
        clip = renderer.render(path)
        coloured = points.render(0, clip)
        works: dict[str, Callable[[], Any]] = {
            "generator_passes": lambda: renderer.render(path),
            "depth": lambda: [renderer.depth(camera) for camera in path],
            "distance": lambda: [condition.distance for condition in clip],
            "normal_camera": lambda: [condition.normal_camera for condition in clip],
            "points_and_visibility": lambda: points.render(0, clip),
            "files": lambda: save_conditions(folder / "clip", clip, coloured),
        }
        with progress.task("Benchmark of the conditions", repeats * len(works)) as task:
            passes = {}
            for name, work in works.items():
                turns = []
                for _ in range(repeats):
                    turns.append(_seconds(work))
                    task.advance()
                wall_s, cpu_s = np.min(turns, axis=0) / FRAMES
                passes[name] = {"wall_ms": float(1e3 * wall_s), "cpu_ms": float(1e3 * cpu_s)}
        clip_bytes = sum(file.stat().st_size for file in (folder / "clip").iterdir())
    wall_ms = passes["generator_passes"]["wall_ms"]
    return {
        "machine": processor(),
        "threads": numba.get_num_threads(),
        "load": load,
        "renderer": renderer.name,
        "triangles": len(proxy.faces),
        "size": f"{lens.width}x{lens.height}",
        "frames": FRAMES,
        "captures": _CAPTURES,
        "frames_per_s": 1e3 / wall_ms,
        "frames_per_s_with_points": 1e3 / (wall_ms + passes["points_and_visibility"]["wall_ms"]),
        "passes": passes,
        "clip_mb": clip_bytes / 1e6,
    }


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    load = "unknown" if f["load"] is None else f"{f['load']:.1f}"
    text = [
        f"{f['machine']}, {f['threads']} threads, load {load}",
        f"{f['renderer']}, {f['triangles']} triangles at {f['size']}",
        f"  {f['frames_per_s']:.1f} frames/s",
        f"  {f['frames_per_s_with_points']:.1f} frames/s with the colours of {f['captures']} captures",
    ]
    for name, cost in f["passes"].items():
        title = name.replace("_", " ")
        text.append(f"  {title:22} {cost['wall_ms']:7.2f} ms a frame ({cost['cpu_ms']:.2f} ms CPU)")
    return [*text, f"  a clip of {f['frames']} frames on disk: {f['clip_mb']:.1f} MB"]


def _captures(folder: Path, lens: Camera) -> list[Capture]:
    """Photographs of waves, from places along the path that no frame is at."""
    u, v = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    waves = [0.5 + 0.4 * np.sin((u * np.cos(turn) + v * np.sin(turn)) / _WAVE_PX) for turn in range(3)]
    save_image(folder / "photograph.png", np.stack(waves, axis=-1))
    cameras = made_up_path(lens, 4 * _CAPTURES + 1)[2::4]
    return [Capture(f"{k}", folder / "photograph.png", camera) for k, camera in enumerate(cameras)]


def _seconds(work: Callable[[], Any]) -> tuple[float, float]:
    """How long ``work`` takes by the clock, and of the processor."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall_s, time.process_time() - cpu_s
