"""A whole plan runs by itself, and what was recorded says why each trial counts as it does."""

from trials.declarations import declared

from r2sego_blender.core.digests import content_digest
from r2sego_blender.trials.line.simulated import simulated_calibration
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.study import freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.running.clock import SimulatedClock
from r2sego_blender.trials.running.connection import Connection
from r2sego_blender.trials.running.judged_record import judged_record
from r2sego_blender.trials.running.live import State
from r2sego_blender.trials.running.session import Session
from r2sego_blender.trials.running.simulated import SimulatedBench, SimulatedOperator, simulated_scripts


def run_simulated(study, plan, show=lambda live: None):
    clock = SimulatedClock()
    bench = SimulatedBench(clock)
    operator = SimulatedOperator(plan, bench, clock, simulated_scripts(plan))
    Session(study, Connection(bench.open_line, clock), simulated_calibration(), operator, show, clock).run()


def test_a_small_plan_runs_to_its_end(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 2"))
    seen = []
    run_simulated(study, plan, lambda live: seen.append(live))
    entries = RecordIndex(study).entries()
    usable = [entry for entry in entries if entry.judgement.outcome is not Outcome.UNUSABLE]
    assert sorted(entry.trial for entry in usable) == list(range(len(plan.trials)))
    assert len({entry.number for entry in entries}) == len(entries) > len(usable)
    for entry in entries:
        record = read_record(study / "records" / entry.name)
        assert record.finished and content_digest(record.file) == entry.sha256
        assert judged_record(record) == entry.sensors, entry
    assert seen[-1].state is State.FINISHED
    assert {live.state for live in seen} >= {State.SET_UP, State.ARMED, State.RUNNING, State.ENDED, State.JUDGED}
