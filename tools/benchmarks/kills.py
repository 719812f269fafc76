"""How a refinement stands being killed: each run is killed once with SIGKILL, resumed, and compared.

    python -m tools.benchmarks.kills build/kills --count 50

The demo room is refined with few steps, once undisturbed and ``count`` times killed at a moment drawn
uniformly from the time that takes. Every result of the resumed run has to have the digest of the
undisturbed one, and nothing may be left: no file on its way, no process.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2sego_blender.bundle.journal import Journal
from r2sego_blender.core.atomic_files import CHANGES, UNFINISHED
from r2sego_blender.core.digests import content_digest
from r2sego_blender.workers.engine import engine_environment

ROOM = Path(__file__).resolve().parents[2] / "demo" / "room"
FEW = (
    *("rounds=1", "captures.max_side_px=160", "captures.matcher=sift", "stereo.max_side_px=160", "stereo.iterations=1"),
    *("stereo.geometric_rounds=1", "proxy.voxel_m=0.06", "collision.simplification_m=0.1", "collision.cell_m=1.0"),
    *("collision.min_cell_m=0.2", "collision.tolerance_m=0.1", "collision.carrying_tolerance_m=0.1"),
    *("rollouts.successes=1", "selection.target_views=2", "selection.scoring_scale=0.25", "generation.clip_frames=3"),
    *("training.steps_per_round=40", "training.disc_stride_px=6", "training.max_gaussians=20000"),
)
"""Settings of a refinement of half a minute."""

_MARK = "R2SEGO_KILLED_RUN"  # in the environment of a run and of all it starts
_GONE_S = 2.0


@dataclass(frozen=True)
class Killed:
    """A run that was killed after ``after_s``: the results that differ, and what was left, by name."""

    after_s: float
    differing: tuple[str, ...]
    left: tuple[str, ...]


def killed_runs(folder: Path, count: int, seed: int) -> list[Killed]:
    """Kill and resume ``count`` refinements in ``folder``, which is emptied."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    fresh = folder / "fresh.r2s"
    _finish(_started("new", str(fresh), "--captures", str(ROOM / "captures"), "--poses", str(ROOM / "cameras.json")))
    whole = folder / "whole.r2s"
    for _ in range(2):  # the first compiles the kernels, which no later run does
        shutil.rmtree(whole, ignore_errors=True)
        shutil.copytree(fresh, whole)
        began_s = time.monotonic()
        _finish(_refine(whole))
        lasted_s = time.monotonic() - began_s
    expected = _digests(whole)
    runs = []
    for index, share in enumerate(np.random.default_rng(seed).random(count)):
        runs.append(_killed(fresh, folder / "killed.r2s", share * lasted_s, expected, f"{os.getpid()}-{index}"))
        print(f"{index + 1:3d} of {count}: {runs[-1]}", flush=True)
    return runs


def _killed(fresh: Path, scene: Path, after_s: float, expected: Mapping[str, str], mark: str) -> Killed:
    shutil.rmtree(scene, ignore_errors=True)
    shutil.copytree(fresh, scene)
    run = _refine(scene, mark)
    time.sleep(after_s)
    run.kill()
    run.wait()
    until_s = time.monotonic() + _GONE_S
    while (processes := _marked(mark)) and time.monotonic() < until_s:
        time.sleep(0.1)
    _finish(_refine(scene))
    found = _digests(scene)
    names = sorted(expected.keys() | found.keys())
    differing = tuple(name for name in names if expected.get(name) != found.get(name))
    files = [place for place in scene.rglob("*") if place.name.startswith(UNFINISHED) or place.name == CHANGES]
    return Killed(round(after_s, 2), differing, (*map(str, files), *processes))


def _started(*arguments: str, mark: str = "") -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "r2sego_blender", *arguments],
        env=engine_environment() | {_MARK: mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def _refine(scene: Path, mark: str = "") -> subprocess.Popen:
    return _started("refine", str(scene), "--preset", "preview", *(f"--set={one}" for one in FEW), mark=mark)


def _finish(run: subprocess.Popen) -> None:
    """Wait for a run, which has to end well."""
    _, told = run.communicate()
    if run.returncode != 0:
        raise SystemExit(f"r2sego ended with status {run.returncode}: {told[-2000:]}")


def _digests(scene: Path) -> dict[str, str]:
    """The digests of all that the steps published, as it lies there now."""
    return {name: content_digest(scene / name) for name in Journal(scene).outputs()}


def _marked(mark: str) -> list[str]:
    """The processes that still run of a run's, where /proc tells of them."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"{_MARK}={mark}".encode() in (place / "environ").read_bytes().split(b"\0"):
                found.append(f"process {place.name}")
        except OSError:
            continue
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="is emptied")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    runs = killed_runs(options.folder, options.count, options.seed)
    bad = [run for run in runs if run.differing or run.left]
    print(
        f"{len(runs) - len(bad)} of {len(runs)} killed runs ended with the undisturbed run's digests and left nothing"
    )
    print(f"{platform.machine()}, {os.cpu_count()} cores")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
