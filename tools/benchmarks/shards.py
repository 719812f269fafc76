"""Blenders that share a path's frames: is each rendered once, how fast beside rendering alone, and in what memory.

Workers are processes with pip's bpy. By turns each renders frames that are its own beforehand, with nothing to agree
on, and frames that all share: so whatever else the machine does slows both.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from r2sego_blender.commands.bench_defaults import CONDITIONS_TRIANGLES, SHARED_FRAMES, SHARED_SIZE, SHARED_WORKERS
from r2sego_blender.core.errors import MachineError, SettingsError
from r2sego_blender.core.json_files import read_json
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor

from .workloads import made_up_proxy, parse_size

_TURN = 100
"""Frames of a turn, of all workers together."""

_ROOT = Path(__file__).resolve().parents[2]
_BLENDER = "tools.benchmarks.shard_worker"


def bench_shards(
    frames: int = SHARED_FRAMES,
    workers: int = SHARED_WORKERS,
    triangles: int = CONDITIONS_TRIANGLES,
    size: str = SHARED_SIZE,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Render ``frames`` of a made-up room with Cycles by so many ``workers`` that share them.

    Returns JSON-ready figures: frames/s of a worker alone and where all share (``rate``, of the former), how many were
    rendered and how many turns' paths are not whole, and by how many MB the memory of a worker grew after its first
    turn. Raises SettingsError for options that cannot be, MachineError without bpy or where a worker fails.
    """
    parse_size(size)
    if frames < 2 * workers or workers < 1 or triangles < 1:
        raise SettingsError(
            "that is too little",
            where="--frames, --workers, --triangles",
            cure="Give two frames a worker, and some faces.",
        )
    if importlib.util.find_spec("bpy") is None:
        raise MachineError("pip's bpy is not installed", where="bench", cure="Run `make install-tests`.")
    with tempfile.TemporaryDirectory(prefix="r2sego-shared-") as temporary:
        folder = Path(temporary)
        made_up_proxy(triangles).save(folder / "proxy.npz")
        command = [sys.executable, "-m", _BLENDER, str(folder), str(frames), str(workers), size]
        running = []
        for worker in range(workers):
            with (folder / f"worker_{worker}.log").open("wb") as log:
                running.append(subprocess.Popen([*command, str(worker)], cwd=_ROOT, stdout=log, stderr=log))
        try:
            for worker, process in enumerate(progress.track(running, "Blenders that share frames")):
                if process.wait():
                    said = (folder / f"worker_{worker}.log").read_text(encoding="utf-8", errors="replace").splitlines()
                    raise MachineError(
                        f"a worker failed: {said[-1] if said else ''}", where="bench", cure="See its words."
                    )
        finally:
            for process in running:
                process.kill()
                process.wait()
        told = [read_json(folder / f"worker_{worker}.json") for worker in range(workers)]
        missing = sum(not (folder / "shared" / name / "manifest.json").is_file() for name in turns(frames))
    alone = sum(one["alone_frames"] for one in told) / sum(one["alone_s"] for one in told)
    shared = sum(one["shared_frames"] for one in told) / sum(one["shared_s"] for one in told)
    return {
        "machine": processor(),
        "workers": workers,
        "triangles": triangles,
        "size": size,
        "frames": frames,
        "alone_frames_per_s": alone,
        "shared_frames_per_s": shared,
        "rate": shared / alone,
        "rendered": sum(one["shared_frames"] for one in told),
        "unfinished_turns": missing,
        "grown_mb": max(one["memory_mb"][-1] - one["memory_mb"][0] for one in told),
        "memory_mb": max(one["memory_mb"][-1] for one in told),
    }


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    rates = f"{f['alone_frames_per_s']:.2f} frames/s of each alone, {f['shared_frames_per_s']:.2f} where they share"
    whole = "all paths are whole" if not f["unfinished_turns"] else f"{f['unfinished_turns']} paths lack frames"
    return [
        f"{f['machine']}, {f['workers']} Blenders, {f['triangles']} triangles at {f['size']}, Cycles",
        f"{rates}: {100 * f['rate']:.1f} %",
        f"{f['frames']} frames shared, {f['rendered']} rendered; {whole}",
        f"memory {f['memory_mb']:.0f} MB, grown by {f['grown_mb']:.0f} MB since the first turn",
    ]


def turns(frames: int) -> dict[str, range]:
    """The frames of each turn, by its name."""
    return {f"{first:04d}": range(first, min(first + _TURN, frames)) for first in range(0, frames, _TURN)}
