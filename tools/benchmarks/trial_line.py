"""How a session stands a fast line and being killed: lost samples, its share of a core, and what records keep.

    python -m tools.benchmarks.trial_line load build/load --seconds 600
    python -m tools.benchmarks.trial_line kills build/kills --count 50

``load`` records one trial from a simulated device at 1 kHz behind a terminal, and looks for every sample in the
record. ``kills`` starts sessions and kills each with SIGKILL at a moment drawn uniformly while it records: all up to
the last whole chunk has to be read, and the next session goes on behind it.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2sego_blender.trials.line.simulated import simulated_calibration, simulated_device
from r2sego_blender.trials.plan.study import freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import Record, read_record
from r2sego_blender.trials.running.controls import Control, send
from r2sego_blender.trials.running.judged_record import stream_of
from r2sego_blender.workers.engine import engine_environment

_DECLARATION = """name = "load"
chairs = ["chair"]
trials = 1
[chair]
x_m = [2.0, 2.0]
y_m = [0.0, 0.0]
heading_deg = [180.0, 180.0]
[robot]
distance_m = [1.0, 1.0]
bearing_deg = [0.0, 0.0]
facing_deg = [0.0, 0.0]
[rules]
timeout_s = 600.0
[[policies]]
condition = "A"
seed = 1
file = "policy.onnx"
"""


@dataclass(frozen=True)
class Load:
    """A recorded line: the device's ``samples``, how many were ``lost``, and the recorder's ``share`` of a core."""

    seconds: float
    samples: int
    lost: int
    resets: int
    share: float


@dataclass(frozen=True)
class Killed:
    """A recorder that was killed after ``after_s``: what it had written, what was read of it, and what is wrong."""

    after_s: float
    file_bytes: int
    read_bytes: int
    problem: str


def recorded_load(folder: Path, seconds: float, rate_hz: int = 1000) -> Load:
    """Record a trial of so long at this rate, in ``folder``, which is emptied."""
    study, calibration = _study(folder)
    device = simulated_device("idle", rate_hz=rate_hz)
    with device as url:
        session = _Session(study, url, calibration)
        session.start_trial()
        device.play("success")
        began_s, used_s = time.monotonic(), session.used_s()
        time.sleep(seconds)
        lasted_s, used_s = time.monotonic() - began_s, session.used_s() - used_s
        send(study, Control.END)
        session.wait_for("JUDGED")
        send(study, Control.STOP)
        session.end()
    stream = stream_of(_last_record(study))
    sent = int(stream.sequence[-1] - stream.sequence[0]) + 1
    return Load(lasted_s, len(stream.sequence), sent - len(stream.sequence), len(stream.resets_ns), used_s / lasted_s)


def killed_recorders(folder: Path, count: int, seed: int, rate_hz: int = 1000) -> list[Killed]:
    """Kill ``count`` recorders in the study in ``folder``, which is emptied."""
    study, calibration = _study(folder)
    found: list[Killed] = []
    for index, share in enumerate(np.random.default_rng(seed).random(count)):
        with simulated_device("idle", rate_hz=rate_hz) as url:
            session = _Session(study, url, calibration)
            session.start_trial()
            after_s = float(share) * 2.0
            time.sleep(after_s)
            session.kill()
        found.append(_killed(study, index + 1, after_s))
        print(f"{index + 1:3d} of {count}: {found[-1]}", flush=True)
    return found


def _killed(study: Path, number: int, after_s: float) -> Killed:
    """What is left of the record with this number, the study's latest."""
    entry = RecordIndex(study).entries()[-1]
    record = read_record(study / "records" / entry.name)
    read = sum(len(piece.data) for piece in record.received)
    stream = stream_of(record)
    problem = ""
    if entry.number != number:
        problem = f"number {entry.number} in place of {number}"
    elif entry.judgement.outcome.name != "UNUSABLE" or record.complete:
        problem = "it counts as complete"
    elif len(stream.sequence) and int(np.diff(stream.sequence).max(initial=1)) != 1:
        problem = "samples are missing within it"
    elif _kept_s(record) < after_s - 1.0:
        problem = f"only {_kept_s(record):.2f} s of {after_s:.2f} s are kept"
    return Killed(round(after_s, 3), record.file.stat().st_size, read, problem)


def _kept_s(record: Record) -> float:
    """How long what is kept lasts."""
    times = [piece.received_ns for piece in record.received]
    return (times[-1] - times[0]) / 1e9 if times else 0.0


def _study(folder: Path) -> tuple[Path, Path]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "policy.onnx").write_bytes(b"policy")
    (folder / "load.toml").write_text(_DECLARATION)
    simulated_calibration().save(folder / "calibration.json")
    return freeze_plan(folder / "load.toml")[1], folder / "calibration.json"


def _last_record(study: Path) -> Record:
    return read_record(study / "records" / RecordIndex(study).entries()[-1].name)


class _Session:
    """``r2sego trials run`` as a process, driven as Blender drives it."""

    def __init__(self, study: Path, url: str, calibration: Path) -> None:
        self._study = study
        self._told = study.parent / "events.jsonl"
        with self._told.open("wb") as events:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "r2sego_blender", "trials", "run", str(study), "--device", url),
                    *("--calibration", str(calibration), "--json-progress"),
                ],
                env=engine_environment(),
                stdout=events,
                stderr=subprocess.PIPE,
                stdin=subprocess.DEVNULL,
            )

    def start_trial(self) -> None:
        self.wait_for("SET_UP")
        send(self._study, Control.ARM)
        self.wait_for("ARMED")
        send(self._study, Control.START)
        self.wait_for("RUNNING")

    def wait_for(self, state: str, limit_s: float = 300.0) -> None:
        until_s = time.monotonic() + limit_s
        while not self._is(state):
            if self._process.poll() is not None or time.monotonic() > until_s:
                raise SystemExit(f"no state {state}: {self._words()}")
            time.sleep(0.02)

    def _is(self, state: str) -> bool:
        """Whether the last whole line told says so."""
        with self._told.open("rb") as told:
            told.seek(max(0, told.seek(0, os.SEEK_END) - 8192))
            whole = told.read().split(b"\n")[:-1]
        return bool(whole) and f'"state": "{state}"'.encode() in whole[-1]

    def used_s(self) -> float:
        """Processor time so far, seconds, as /proc tells it."""
        fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()

    def end(self) -> None:
        _, words = self._process.communicate(timeout=60.0)
        if self._process.returncode:
            raise SystemExit(f"r2sego ended with status {self._process.returncode}: {words.decode()[-2000:]}")

    def _words(self) -> str:
        self._process.kill()
        return self._process.communicate()[1].decode()[-2000:]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("load", "kills"))
    parser.add_argument("folder", type=Path, help="is emptied")
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.what == "load":
        load = recorded_load(options.folder, options.seconds)
        print(f"{load.samples} samples in {load.seconds:.0f} s, {load.lost} lost, {100 * load.share:.1f} % of a core")
        bad = load.lost or load.resets or load.share > 0.05
    else:
        runs = killed_recorders(options.folder, options.count, options.seed)
        bad = any(run.problem for run in runs)
        print(f"{sum(not run.problem for run in runs)} of {len(runs)} killed records were read to their last chunk")
    print(f"{platform.machine()}, {os.cpu_count()} cores")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
