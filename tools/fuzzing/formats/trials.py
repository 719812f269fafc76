"""What a study of trials holds, the calibration of its device, and what the device sends."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..harness import Harness

_DECLARATION = """name = "sitting"
trials = 2
order = "randomised"
blinded = true
tether = "gate"
seed = 3
floor = [[-1.0, -2.0], [4.0, -2.0], [4.0, 2.0]]
chairs = ["office chair", "stool"]
chair = {x_m = [2.0, 2.4], y_m = [-0.5, 0.5], heading_deg = [150.0, 180.0]}
robot = {distance_m = [1.0, 1.5], bearing_deg = [-20.0, 20.0], facing_deg = [-10.0, 10.0]}
rules = {support_s = 3.0, tether_n = 30.0, rerun = "at_end"}
"""
_POLICY = """
[[policies]]
condition = "%s"
seed = %d
sha256 = "%s"
simulated_successes = 22
"""


def _declared(folder: Path) -> None:
    policies = [
        _POLICY % (condition, seed, f"{condition}{seed}".rjust(64, "0")) for condition in ("a", "b") for seed in (1, 2)
    ]
    (folder / "a.toml").write_text(_DECLARATION + "".join(policies), encoding="utf-8")


def _study(folder: Path) -> None:
    from r2sego_blender.trials.plan.study import begin_study, end_study, freeze_plan

    _declared(folder)
    plan, study = freeze_plan(folder / "a.toml")
    begin_study(study, plan)
    end_study(study, "the floor was wet")


def _read_declaration(folder: Path) -> Any:
    from r2sego_blender.trials.plan.declaration import Declaration
    from r2sego_blender.trials.plan.drawing import drawn_plan

    file = folder / "a.toml"
    return drawn_plan(Declaration.load(file), file)


def _read_plan(folder: Path) -> Any:
    """As ``TrialPlan.load`` does once the digest is right, and as pages have it."""
    from r2sego_blender.trials.plan.page import plan_page
    from r2sego_blender.trials.plan.trial_plan import parsed_plan

    file = folder / "a.trials" / "plan.json"
    plan = parsed_plan(file.read_bytes(), file)
    return plan, plan_page(plan)


def _read_frozen(folder: Path) -> Any:
    from r2sego_blender.trials.plan.trial_plan import TrialPlan

    return TrialPlan.load(folder / "a.trials")


def _read_state(folder: Path) -> Any:
    from r2sego_blender.trials.plan.study import state_of

    return state_of(folder / "a.trials")


def _calibration(folder: Path) -> None:
    from r2sego_blender.trials.line.simulated import simulated_calibration

    simulated_calibration().save(folder / "cells.json")


def _read_calibration(folder: Path) -> Any:
    import numpy as np

    from r2sego_blender.trials.calibration.calibration import Calibration

    read = Calibration.load(folder / "cells.json")
    lines = [(one.zero, one.counts_per_newton, one.residuals_n) for one in read.channels]
    raw = np.array([[-(1 << 31)] * len(lines), [(1 << 31) - 1] * len(lines)])
    return read, read.newtons(raw), read.digest, read.age_days(0.0), lines


def _line(folder: Path) -> None:
    from r2sego_blender.trials.line.framing import hello_line, sample_line

    sent = [hello_line("cells-1", "1.0", 7, 80, [("tether", -8388608, 8388607), ("seat", 0, 4095)])]
    sent += [sample_line(65530 + n, 4294960000 + 12500 * n, [84210 + n, n], n % 8) for n in range(6)]
    (folder / "a.line").write_bytes(b"".join(sent))


def _read_line(folder: Path) -> Any:
    from r2sego_blender.trials.line.decoding import Decoder, StreamBuilder
    from r2sego_blender.trials.stream import Hello

    found = Decoder().feed((folder / "a.line").read_bytes(), 1)
    builder = StreamBuilder(next((one for one in found if isinstance(one, Hello)), Hello(1, "", "", 0, 1.0, ())))
    builder.add(found, 1)
    return found, builder.stream()


def _gauge(folder: Path) -> None:
    (folder / "a.line").write_bytes(b"-18.78 lbF\r\n 0.250 kN\r\n+ 12 N\r\n1500.5 mN\r\n")


def _read_gauge(folder: Path) -> Any:
    from r2sego_blender.trials.line.adapters import Mark10

    return Mark10().decoder().feed((folder / "a.line").read_bytes(), 1)


def _recorded(folder: Path) -> None:
    """A study with one simulated trial."""
    from r2sego_blender.trials.line.simulated import simulated_calibration
    from r2sego_blender.trials.plan.study import freeze_plan
    from r2sego_blender.trials.running.clock import SimulatedClock
    from r2sego_blender.trials.running.connection import Connection
    from r2sego_blender.trials.running.controls import Control, Told
    from r2sego_blender.trials.running.live import Live, State
    from r2sego_blender.trials.running.session import Session
    from r2sego_blender.trials.running.simulated import SimulatedBench, SimulatedOperator

    _declared(folder)
    plan, study = freeze_plan(folder / "a.toml")
    clock = SimulatedClock(wall_ns=1_790_000_000_000_000_000)
    bench = SimulatedBench(clock, rate_hz=25)

    class Once(SimulatedOperator):
        def acts(self, live: Live) -> list[Told]:
            done = [Told(Control.NOTE, {"text": "a note"}), Told(Control.STOP, {})]
            return done if live.state is State.JUDGED else super().acts(live)

    operator = Once(plan, bench, clock, lambda trial, tried: "success")
    calibration = simulated_calibration(datetime.fromtimestamp(clock.wall_ns() // 10**9, UTC))
    Session(study, Connection(bench.open_line, clock), calibration, operator, clock=clock).run()


def _read_record(folder: Path) -> Any:
    from r2sego_blender.trials.records.judgement_values import judgement_values
    from r2sego_blender.trials.records.reading import read_record
    from r2sego_blender.trials.running.judged_record import judged_record, stream_of

    record = read_record(folder / "a.trials/records/0001.mcap")
    told = [judgement_values(one) for one in (*record.judgements, judged_record(record))]  # null where nothing measured
    return record.about, record.received, record.events, record.lost_ns, stream_of(record), told


def _about(folder: Path) -> None:
    from r2sego_blender.core.json_files import write_json
    from r2sego_blender.trials.records.reading import read_record

    _recorded(folder)
    write_json(folder / "about.json", read_record(folder / "a.trials/records/0001.mcap").about)


def _read_about(folder: Path) -> Any:
    """As it stands in a record's metadata."""
    import dataclasses

    from r2sego_blender.core.errors import TrialError
    from r2sego_blender.core.json_files import opened_json
    from r2sego_blender.trials.records.judgement_values import judgement_values
    from r2sego_blender.trials.records.reading import read_record
    from r2sego_blender.trials.running.about import About
    from r2sego_blender.trials.running.judged_record import judged_record

    with opened_json(folder / "about.json", TrialError, "it does not say what it is of", "Restore it.") as values:
        about = dict(values)
    record = dataclasses.replace(read_record(folder / "a.trials/records/0001.mcap"), about=about)
    return About.of(record), judgement_values(judged_record(record))


def _read_index(folder: Path) -> Any:
    from r2sego_blender.trials.records.index import RecordIndex
    from r2sego_blender.trials.records.judgement_values import judgement_values

    entries = RecordIndex(folder / "a.trials").entries()
    return [(one.number, one.trial, one.name, one.began, judgement_values(one.judgement)) for one in entries]


def _controls(folder: Path) -> None:
    from r2sego_blender.trials.running.controls import Control, send

    for control in Control:
        send(folder, control, text="a clap", outcome="failure", by="A. Person")


def _read_controls(folder: Path) -> Any:
    from r2sego_blender.trials.running.controls import CONTROLS_FILE, Controls

    file = folder / CONTROLS_FILE
    data = file.read_bytes()
    file.write_bytes(b"")
    controls = Controls(folder)
    file.write_bytes(data)
    return [(told.control.value, told.text()) for _ in range(len(data) // 60_000 + 2) for told in controls.read()]


def _live(folder: Path) -> None:
    from r2sego_blender.core.json_files import write_json
    from r2sego_blender.trials.outcome import Outcome
    from r2sego_blender.trials.running.live import Counts, Live, State

    pose, counts = (1.0, 2.0, 90.0), (Counts("a", 3, 4, 1), Counts("b", 1, 4, 0))
    live = Live(State.JUDGED, "go on", 3, 8, "policy 1", 2, True, pose, pose, "stool", 5, (("seat", 2.5),), 99.0, 0.01)
    last = {"outcome": Outcome.FAILURE.name, "reasons": ["out of time"]}
    write_json(folder / "live.json", live.to_json() | last | {"counts": [vars(one) for one in counts]})


def _read_live(folder: Path) -> Any:
    from r2sego_blender.core.errors import TrialError
    from r2sego_blender.core.json_files import opened_json
    from r2sego_blender.trials.running.live import Live

    with opened_json(folder / "live.json", TrialError, "it is no state of a session", "Run it again.") as values:
        return Live.from_json(values).to_json()


HARNESSES = (
    Harness("trials/record.mcap", _recorded, "a.trials/records/0001.mcap", "bytes", _read_record),
    Harness("trials/about.json", _about, "about.json", "json", _read_about),
    Harness("trials/index.jsonl", _recorded, "a.trials/records/index.jsonl", "lines", _read_index),
    Harness("trials/controls.jsonl", _controls, "controls.jsonl", "lines", _read_controls),
    Harness("trials/live.json", _live, "live.json", "json", _read_live),
    Harness("trials/calibration.json", _calibration, "cells.json", "json", _read_calibration),
    Harness("trials/line", _line, "a.line", "header", _read_line),
    Harness("trials/gauge", _gauge, "a.line", "header", _read_gauge),
    Harness("trials/declaration.toml", _declared, "a.toml", "toml", _read_declaration),
    Harness("trials/plan.json", _study, "a.trials/plan.json", "json", _read_plan),
    Harness("trials/plan.sha256", _study, "a.trials/plan.sha256", "text", _read_frozen),
    Harness("trials/begun.json", _study, "a.trials/begun.json", "json", _read_frozen),
    Harness("trials/ended.json", _study, "a.trials/ended.json", "json", _read_state),
)
