"""One cell, from its captures to its record: the program's own commands, each in a process of its own.

A cell that was begun goes on where its bundle stands. What a command says is in the cell's ``log.txt``.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..bundle.layout import COLLISION, GROUND_PICTURES, REFINED_ASSET
from ..bundle.scene import Scene
from ..config.presets import of_captures
from ..core.atomic_files import UNFINISHED, linked, remove, rename
from ..core.errors import ExperimentError, R2SEgoError
from ..core.file_locks import wait_for_lock
from ..workers.child import RUNNING, forget
from ..workers.engine import LIBRARY, engine_environment
from ..workers.processes import DYING_WITH_PARENT
from .cells import Cell
from .equipment import equipment
from .inputs import frozen_digest
from .records import Record, Stage, final_record, made_by, read_record

LOG = "log.txt"
LOCK = ".lock"
"""In a cell's folder, beside its bundle."""

PROGRAM = (sys.executable, "-m", LIBRARY.name)
"""What a cell's commands are given to."""

_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # OpenBLAS has one, as in all commands
_RESULTS = ("rounds", "report", REFINED_ASSET, COLLISION)
_LAST_WORDS = 300


@dataclass(frozen=True)
class Outcome:
    """What became of a cell: its record, or why there is none; ``lost`` where the machine that did it is gone."""

    record: Record | None
    failure: str = ""
    lost: bool = False


RunCell = Callable[[Cell], Outcome]
"""How a scheduler has a cell done, in any process on any machine that sees its folder."""


def run_cell(cell: Cell, program: Sequence[str] = PROGRAM, patience_s: float = 60.0) -> Outcome:
    """Do what is left of a cell, and write its record; failures come back, and are not raised.

    A cell that another process does is waited for so long, and not done again where it has come to its end: a
    machine that was given up may have written its record before, or an earlier experiment may still be ending.
    """
    try:
        cell.folder.mkdir(parents=True, exist_ok=True)
        with _alone(cell, patience_s):
            at_hand = equipment(cell.arms)
            record = final_record(cell.folder, cell.key, at_hand)
            if record is None:
                _done(cell, program, at_hand).write(cell.folder)
                record = read_record(cell.folder)  # as the next run will find it, to the byte
    except Exception as error:
        return failure(cell, error)
    return Outcome(record)


def failure(cell: Cell, error: Exception) -> Outcome:
    """What became of a cell that an error ended, of whatever type: nothing else ends with it."""
    if isinstance(error, R2SEgoError):
        return Outcome(None, str(error))
    if isinstance(error, OSError):
        return Outcome(None, f"{error.filename or cell.folder}: {error.strerror or error}")
    return Outcome(None, f"{cell.folder}: {type(error).__name__}: {error}")


@contextlib.contextmanager
def _alone(cell: Cell, patience_s: float) -> Iterator[None]:
    """Within its ``with`` block no other process does the cell. Raises ExperimentError where one keeps on doing it."""
    with (cell.folder / LOCK).open("ab") as file:
        if not wait_for_lock(file, patience_s):
            raise ExperimentError(
                "another process does this cell", where=cell.name, cure="Wait until it has ended, or end it."
            )
        yield


def _done(cell: Cell, program: Sequence[str], at_hand: Mapping[str, str]) -> Record:
    stages = []
    if cell.shared is not None:
        cell.imported.parent.mkdir(parents=True, exist_ok=True)
        try:
            stages.append(_command("new", [*program, "new", str(cell.imported), *_import_options(cell)], cell))
        except ExperimentError:
            if not cell.imported.exists():  # else another made it at the same time
                raise
    if not cell.bundle.exists():
        copy_bundle(cell.imported, cell.bundle)
    _declare(cell)
    asked = ["--frozen", str(cell.scene.frozen), "--arms", ",".join(cell.arms), "--distinct"]
    if cell.refined:
        stages.append(_command("refine", [*program, "refine", str(cell.bundle)], cell))
    else:
        asked.append("--baselines-only")
    stages.append(_command("evaluate", [*program, "evaluate", str(cell.bundle), *asked], cell))
    if frozen_digest(cell.scene.frozen) != cell.inputs.frozen_sha256:
        raise ExperimentError(
            "the frozen views were changed while the cell was scored", where=cell.scene.frozen, cure="Put them back."
        )
    scene = Scene.open(cell.bundle)
    metrics = scene.read(cell.metrics)
    not_scored = {arm: why for arm, why in metrics.get("not_scored", {}).items() if arm in cell.arms}
    if missing := [arm for arm in cell.arms if arm not in {*metrics.get("arms", ()), *not_scored}]:
        raise ExperimentError(
            f"its scores lack {', '.join(missing)}", where=cell.bundle, cure="Remove the cell's folder."
        )
    arms = {arm: metrics["arms"][arm] for arm in cell.arms if arm not in not_scored}
    steps = {record["step"]: record.get("seconds", 0.0) for record in scene.journal()}
    finished = round(time.time(), 3)
    assets = metrics.get("assets", {})
    return Record(cell.key, arms, assets, tuple(stages), steps, made_by(), finished, not_scored, at_hand)


def _import_options(cell: Cell) -> list[str]:
    scene = cell.scene
    given = {"--poses": scene.poses, "--robot": scene.robot, "--scope": scene.scope}
    options = ["--captures", str(scene.captures), "--first", str(cell.captures)]
    for name, value in {**given, "--camera-height": scene.camera_height}.items():
        options += [name, str(value)] if value else []
    for key, value in scene.overrides:
        options += ["--set", f"{key}={value}"]
    return options


def copy_bundle(source: Path, bundle: Path, patience_s: float = 60.0) -> None:
    """A bundle of the same captures, and of what else is no result of a refinement; there whole, or not at all.

    Cells that begin together copy one after the other: who holds the ``source`` is waited for so long.
    Files are hard links where the disk has them: what a bundle publishes takes a file's place, and changes none.
    """

    def left_out(folder: str, names: list[str]) -> list[str]:
        if Path(folder) == source:
            return [name for name in names if name.startswith(".") or name in _RESULTS]
        return [name for name in names if name.startswith(".")]

    staging = bundle.with_name(UNFINISHED + bundle.name)
    remove(staging)
    try:
        with Scene.open(source).held_still(patience_s):
            shutil.copytree(source, staging, ignore=left_out, copy_function=linked)
            if (source / GROUND_PICTURES).is_dir():
                shutil.copytree(source / GROUND_PICTURES, staging / GROUND_PICTURES, copy_function=linked)
        rename(staging, bundle)
    finally:
        remove(staging)


def _declare(cell: Cell) -> None:
    """The cell's settings, in place of those that its bundle had before; what the import was made with stays."""
    scene = Scene.open(cell.bundle)
    with scene.locked():
        overrides = {**of_captures(scene.declaration.overrides), **dict(cell.preset.overrides), "seed": cell.seed}
        scene.declare(preset=cell.preset.preset, overrides=overrides)


def _command(name: str, command: Sequence[str], cell: Cell) -> Stage:
    """Run a command to its end; what it took. Raises ExperimentError with its last words where it fails."""
    started_s = time.monotonic()
    variables = {**engine_environment(), **dict.fromkeys(_THREADS, str(cell.threads))}
    with (cell.folder / LOG).open("ab") as log:
        log.write(f"$ r2sego {' '.join(command[len(PROGRAM) :])}\n".encode(errors="backslashreplace"))
        log.flush()
        begins = log.tell()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=variables, **DYING_WITH_PARENT
        )
        RUNNING.add(process)
        try:
            cpu_s, peak_mb = _waited(process)
        finally:
            process.kill()
            forget(process)
    if process.returncode != 0:
        said = _last_words(cell.folder / LOG, begins)
        raise ExperimentError(
            f"{name} ended with status {process.returncode}{said}", where=cell.name, cure=f"See {cell.folder / LOG}."
        )
    return Stage(name, round(time.monotonic() - started_s, 3), cpu_s, peak_mb)


def _waited(process: subprocess.Popen) -> tuple[float | None, float | None]:
    """Processor seconds and the most memory, MB, of a process and those it waited for, once it has ended."""
    if sys.platform == "win32":
        process.wait()
        return None, None
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return round(usage.ru_utime + usage.ru_stime, 3), round(usage.ru_maxrss / unit, 1)


def _last_words(log: Path, begins: int) -> str:
    with log.open("rb") as file:
        file.seek(begins)
        lines = [line for line in file.read()[-4096:].decode(errors="replace").splitlines() if line.strip()]
    return f": {lines[-1].strip()[:_LAST_WORDS]}" if lines else ""
