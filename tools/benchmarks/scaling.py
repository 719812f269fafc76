"""What many scenes take by the seconds of one, and whether the scheduler keeps that: its cells sleep for them."""

from __future__ import annotations

import queue
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from r2sego_blender.bundle.scene import Scene
from r2sego_blender.commands.bench_defaults import SCALING_FASTER, SCALING_SCENES, SCALING_SLOTS
from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.formatting import duration
from r2sego_blender.core.progress import SILENT, Progress
from r2sego_blender.core.resources import processor
from r2sego_blender.experiments.cells import Cell
from r2sego_blender.experiments.experiment import Experiment, Tables, run_experiment
from r2sego_blender.experiments.records import Record, Stage
from r2sego_blender.experiments.running import Outcome, RunCell
from r2sego_blender.experiments.scheduling import schedule

from .sleeping.cells import SleepingCells, Steps
from .sleeping.program import scene_factor

SPREAD = 0.3
"""By how much of its time a scene of the check takes more or less than the measured one."""

_MANY = 10_000


def bench_scaling(
    bundle: Path,
    scenes: int = SCALING_SCENES,
    slots: int = SCALING_SLOTS,
    faster: int = SCALING_FASTER,
    progress: Progress = SILENT,
) -> dict[str, Any]:
    """Run ``scenes`` cells on ``slots`` at once, each asleep for its steps' seconds in ``bundle``, ``faster`` times so.

    Returns JSON-ready figures: the seconds of each stage of the bundle's scene, what ``scenes`` of them come to on the
    ``slots`` and what they took, and what the scheduler itself takes for each of 10,000 cells. Raises SettingsError for
    numbers below 1 and a bundle without steps, SceneError for what is none.
    """
    for option, value in (("--scenes", scenes), ("--slots", slots), ("--faster", faster)):
        if value < 1:
            raise SettingsError(f"{value} is too few", where=option, cure="Give 1 at least.")
    seconds = {step["step"]: float(step.get("seconds", 0.0)) for step in Scene.open(bundle).journal()}
    if not sum(seconds.values()):
        raise SettingsError("nothing was refined there", where=bundle, cure="Name a bundle that was refined.")
    with tempfile.TemporaryDirectory(prefix="r2sego-scaling-") as folder, progress.task("Scaling", 2) as task:
        taken_s, factors = _asleep(Path(folder, "asleep"), seconds, scenes, slots, faster)
        task.advance()
        own_s = _own_seconds(Path(folder, "many"), slots)
        task.advance()
    scene_s = sum(seconds.values())
    return {
        "machine": processor(),
        "bundle": str(bundle),
        "bundle_bytes": sum(file.stat().st_size for file in bundle.rglob("*") if file.is_file()),
        "stages": stages_of(seconds),
        "scene_s": scene_s,
        "scenes": scenes,
        "slots": slots,
        "faster": faster,
        "reckoned_s": reckoned_s([factor * scene_s / faster for factor in factors], slots),
        "taken_s": taken_s,
        "scheduling_s_of_10000": own_s,
    }


def reckoned_s(cells_s: Sequence[float], slots: int) -> float:
    """What cells of so many seconds take on so many slots: each gets its share, and the last ones run out.

    On average half of the slots wait while the longest ends, for half of its time; fewer cells than slots take as
    long as the longest.
    """
    if len(cells_s) <= slots:
        return max(cells_s)
    return sum(cells_s) / slots + (slots - 1) / slots * max(cells_s) / 2


def stages_of(seconds: Mapping[str, float]) -> dict[str, float]:
    """Seconds of the steps that do the same in every round, and in every arm of a report."""
    found: defaultdict[str, float] = defaultdict(float)
    for step, taken_s in seconds.items():
        parts = step.split("/")
        name = "rounds, " + parts[2] if parts[0] == "rounds" else "report" if parts[0] == "report" else step
        found[name] += taken_s
    return dict(found)


def lines(figures: dict[str, Any]) -> list[str]:
    """The figures as lines for a person."""
    f = figures
    stages = sorted(f["stages"].items(), key=lambda stage: -stage[1])
    many_s = _MANY * f["scene_s"] / f["slots"]
    off = f["taken_s"] / f["reckoned_s"] - 1.0
    each_ms = 1e3 * f["scheduling_s_of_10000"] / _MANY
    asleep = f"{f['scenes']} sleeping scenes on {f['slots']} at once, {f['faster']} times as fast"
    return [
        f["machine"],
        f"a scene takes {f['scene_s']:.0f} s and {f['bundle_bytes'] / 1e6:.0f} MB:",
        *(f"  {name:28} {taken_s:7.1f} s {100 * taken_s / f['scene_s']:5.1f} %" for name, taken_s in stages),
        f"{_MANY} scenes on {f['slots']} at once: {duration(many_s)}",
        f"{asleep}: {f['taken_s']:.1f} s, reckoned {f['reckoned_s']:.1f} s ({100 * off:+.1f} %)",
        f"the scheduler itself takes {each_ms:.2f} ms of processor for each of {_MANY} cells",
    ]


def _asleep(
    work: Path, seconds: Mapping[str, float], scenes: int, slots: int, faster: int
) -> tuple[float, list[float]]:
    """Seconds that the cells took together, and the factor of each."""
    scored = [(step, taken_s / faster) for step, taken_s in seconds.items() if step.startswith("report/")]
    refined = [(step, taken_s / faster) for step, taken_s in seconds.items() if not step.startswith("report/")]
    cells = SleepingCells.of(work, {"new": [], "refine": refined, "evaluate": scored}, scenes, spread=SPREAD)
    out = work / "out"
    out.mkdir()
    Experiment.of(cells.plan, out)  # digests of the captures are no scheduling
    began_s = time.monotonic()
    _, failures = run_experiment(cells.plan, out, slots, program=cells.program)
    taken_s = time.monotonic() - began_s
    ended = cells.finished("evaluate")
    if failures or len(ended) != scenes or len(set(ended)) != scenes:
        raise SystemExit(f"{len(set(ended))} of {scenes} cells ended, some of them twice: {dict(failures)}")
    return taken_s, [scene_factor(scene.name, SPREAD) for scene in cells.plan.scenes]


class _AtOnce:
    """A runner whose cells are done as they begin."""

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._ended: queue.SimpleQueue[tuple[Cell, Outcome]] = queue.SimpleQueue()

    def at_once(self, threads: int) -> int:
        return self._slots

    def fits(self, needs_mb: float, taken_mb: float) -> bool:
        return True

    def start(self, cell: Cell, run_cell: RunCell, needs_mb: float) -> None:
        self._ended.put((cell, run_cell(cell)))

    def ended(self, timeout_s: float | None) -> tuple[Cell, Outcome] | None:
        return self._ended.get()


def _own_seconds(work: Path, slots: int) -> float:
    """Processor seconds that scheduler and tables take for 10,000 cells that take nothing."""
    nothing: Steps = {"new": [], "refine": [], "evaluate": []}
    plan = SleepingCells.of(work, nothing, 1, _MANY).plan
    begun = Experiment.of(plan, work / "out", write=False)
    for cell in begun.cells:
        cell.imported.mkdir(parents=True, exist_ok=True)
    records: dict[Path, Record] = {}
    tables = Tables(Experiment(plan, work / "out", begun.cells, records))

    def told(cell: Cell, outcome: Outcome, again: bool) -> None:
        if outcome.record is not None:
            records[cell.folder] = outcome.record
        tables.write()

    began_s = time.process_time()
    schedule(begun.cells, _AtOnce(slots), _instantly, begun.expected(), told)
    tables.write(at_the_end=True)
    return time.process_time() - began_s


def _instantly(cell: Cell) -> Outcome:
    views = [{"name": "view.png", "psnr": 20.0, "ssim": 0.5, "lpips_alex": None}]
    arms = {"refined": {"psnr": 20.0, "ssim": 0.5, "lpips_alex": None, "views": views}}
    return Outcome(Record(cell.key, arms, {}, (Stage("refine", 1.0, 1.0, 100.0),), {}, {}, 0.0))
