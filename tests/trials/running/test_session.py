"""A whole plan runs by itself, and what was recorded says why each trial counts as it does."""

import json
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader
from trials.declarations import declared

from r2sego_blender.core.digests import content_digest
from r2sego_blender.core.errors import TrialError
from r2sego_blender.core.file_locks import try_lock
from r2sego_blender.trials.line.adapters import AsciiStream
from r2sego_blender.trials.line.device import Received
from r2sego_blender.trials.line.framing import hello_line
from r2sego_blender.trials.line.simulated import DEVICE, simulated_calibration
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.study import end_study, freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.running.about import About
from r2sego_blender.trials.running.clock import SimulatedClock
from r2sego_blender.trials.running.connection import Connection
from r2sego_blender.trials.running.controls import Control, Told
from r2sego_blender.trials.running.judged_record import judged_record, stream_of
from r2sego_blender.trials.running.live import State
from r2sego_blender.trials.running.session import Session
from r2sego_blender.trials.running.simulated import SimulatedBench, SimulatedOperator, simulated_scripts
from r2sego_blender.trials.tables.counts import Results
from r2sego_blender.trials.tables.success_table import SuccessTable


def run_simulated(
    study, plan, show=lambda live: None, around=lambda operator: operator, scripts=None, calibration=None
):
    clock = SimulatedClock()
    bench = SimulatedBench(clock)
    operator = around(SimulatedOperator(plan, bench, clock, scripts or simulated_scripts(plan)))
    calibration = calibration or simulated_calibration()
    Session(study, Connection(bench.open_line, clock), calibration, operator, show, clock).run()


def decoded(file):
    """The samples in a record, as any other program reads them."""
    found = {"sequence": [], "device_us": [], "raw": [], "flags": []}
    with file.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(topics=["samples"], log_time_order=False):
            for name, values in json.loads(message.data).items():
                found[name] += values
    return found


def test_a_small_plan_runs_to_its_end(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 2"))
    seen, calibration = [], simulated_calibration()
    run_simulated(study, plan, seen.append, calibration=calibration)
    entries = RecordIndex(study).entries()
    usable = [entry for entry in entries if entry.judgement.outcome is not Outcome.UNUSABLE]
    assert sorted(entry.trial for entry in usable) == list(range(len(plan.trials)))
    assert len({entry.number for entry in entries}) == len(entries) > len(usable)
    for entry in entries:
        record = read_record(study / "records" / entry.name)
        assert record.finished and content_digest(record.file) == entry.sha256
        assert judged_record(record) == entry.sensors, entry
        about, trial = About.of(record), plan.trials[entry.trial]
        assert (about.number, about.plan, about.trial, about.rules) == (entry.number, plan.digest, trial, plan.rules)
        assert (about.tethered, about.simulated) == (entry.tethered, True)
        assert record.about["policy_sha256"] == trial.policy_sha256
        assert record.about["calibration_sha256"] == about.calibration.digest == calibration.digest
        samples = decoded(record.file)
        assert np.array_equal(samples["raw"], stream_of(record).raw) and len(samples["sequence"]) > 300
    assert seen[-1].state is State.FINISHED
    assert {live.state for live in seen} >= {State.SET_UP, State.ARMED, State.RUNNING, State.ENDED, State.JUDGED}


@pytest.mark.slow
def test_the_papers_eighty_trials_run_unattended_to_its_table(tmp_path):
    """Simulated devices, a defect every twelfth trial: those are run again, and the counts come out to the digit."""
    plan, study = freeze_plan(declared(tmp_path, "trials = 8", seeds=(1, 2, 3, 4, 5)))
    run_simulated(study, plan)
    results = Results.of(study)
    assert results.complete and results.simulated and len(plan.trials) == 80
    successes = [count.successes for count in results.counts()]
    assert successes == [0, 0, 1, 2, 1, 7, 7, 7, 6, 6]
    text = SuccessTable.of(results.counts(), results.about()).markdown()
    assert "| GaussGym | - | 10.0 ± 10.5 |" in text and "| R2S-EGO | - | 82.5 ± 6.8 |" in text
    unusable = [entry for entry in results.entries if entry.judgement.outcome is Outcome.UNUSABLE]
    assert len(results.entries) == 80 + len(unusable) and len(unusable) >= 6
    for entry in unusable:
        assert judged_record(read_record(study / "records" / entry.name)) == entry.judgement
    policies = {}
    for entry in results.entries:
        passed = policies.setdefault(plan.trials[entry.trial].policy_sha256, [False])
        assert entry.tethered != passed[0]  # untethered only after a tethered success
        passed[0] |= entry.judgement.outcome is Outcome.SUCCESS


def test_a_session_that_was_stopped_goes_on_where_it_was(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    stopped = []

    def stopping(operator):
        def acts(live):
            if live.index == 2 and live.state is State.RUNNING and live.elapsed_s > 1.0 and not stopped:
                stopped.append(live.record)
                return [Told(Control.STOP, {})]
            return operator.acts(live)

        return SimpleNamespace(acts=acts)

    run_simulated(study, plan, around=stopping)
    *_, last = RecordIndex(study).entries()
    assert (last.number, last.trial, last.judgement.outcome) == (stopped[0], 2, Outcome.UNUSABLE)
    run_simulated(study, plan)
    entries = RecordIndex(study).entries()
    usable = [entry.trial for entry in entries if entry.judgement.outcome is not Outcome.UNUSABLE]
    assert sorted(usable) == list(range(6))
    assert [entry.number for entry in entries] == list(range(1, len(entries) + 1))


def test_a_persons_judgement_counts_and_is_in_the_record(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    by_hand = {"outcome": "failure", "by": "A. Person", "text": "held up by the cable"}

    def judging(operator):
        def acts(live):
            if live.state is not State.JUDGED or live.outcome is not Outcome.SUCCESS:
                return operator.acts(live)
            return [Told(Control.NOTE, {"text": "a note"}), Told(Control.JUDGE, by_hand), Told(Control.STOP, {})]

        return SimpleNamespace(acts=acts)

    run_simulated(study, plan, around=judging, scripts=lambda trial, tried: "success")
    (entry,) = RecordIndex(study).entries()
    assert entry.judgement.outcome is Outcome.FAILURE and entry.judgement.manual.startswith("A. Person")
    assert entry.sensors.outcome is Outcome.SUCCESS and not entry.sensors.manual
    record = read_record(study / "records" / entry.name)
    assert record.judgements == (entry.sensors, entry.judgement) and judged_record(record) == entry.sensors
    assert "a note" in [event.text for event in record.events]


def test_counts_stay_hidden_from_a_blinded_operator(tmp_path):
    for blinded in (True, False):
        plan, study = freeze_plan(
            declared(tmp_path, f'trials = 1\norder = "randomised"\nblinded = {str(blinded).lower()}'),
            tmp_path / str(blinded),
        )
        seen = []
        run_simulated(study, plan, seen.append)
        told = {json.dumps(live.to_json()) for live in seen}
        assert all((live.counts is None) == blinded for live in seen)
        assert any(condition in text for text in told for condition in plan.conditions) != blinded


def test_an_ended_study_and_one_that_runs_are_refused(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1"))
    (study / "records").mkdir()
    with (study / "records" / "session.lock").open("ab") as file:
        assert try_lock(file)
        with pytest.raises(TrialError):
            run_simulated(study, plan)
    end_study(study, "the robot broke")
    with pytest.raises(TrialError):
        run_simulated(study, plan)
    assert RecordIndex(study).entries() == []


def test_real_and_simulated_trials_do_not_stand_in_one_study(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1"))
    index = RecordIndex(study)
    index.begin(0, plan.digest, tethered=True, simulated=False)
    with pytest.raises(TrialError):
        run_simulated(study, plan)
    assert len(index.entries()) == 1


def test_a_device_that_began_anew_is_tested_again_before_the_next_trial(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    clock = SimulatedClock()
    bench, states = SimulatedBench(clock), []
    inner = SimulatedOperator(plan, bench, clock, lambda trial, tried: "success")

    def acts(live):
        if not states or states[-1] is not live.state:
            states.append(live.state)
            if states.count(State.SET_UP) == 1:
                bench.play("reset" if live.state is State.SET_UP else "idle")  # after three seconds, of a sitting robot
        if states.count(State.SET_UP) == 1 and live.state is State.SET_UP:
            return []
        if live.state is State.JUDGED:
            return [Told(Control.STOP, {})]
        return inner.acts(live)

    operator = SimpleNamespace(acts=acts)
    Session(study, Connection(bench.open_line, clock), simulated_calibration(), operator, clock=clock).run()
    assert states[:5] == [State.WAITING, State.SELF_TEST, State.SET_UP, State.SELF_TEST, State.SET_UP]


def test_a_device_that_fails_its_test_records_nothing_until_it_passes(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    clock = SimulatedClock()
    bench, told, scripts = SimulatedBench(clock), [], iter(["weights:0:20", "idle"])
    inner = SimulatedOperator(plan, bench, clock, lambda trial, tried: "success")

    def open_line():
        line = bench.open_line()
        bench.play("weights:20:0")
        return line

    def acts(live):
        if live.state is State.JUDGED:
            return [Told(Control.STOP, {})]
        if live.state is not State.SELF_TEST:
            return inner.acts(live)
        if not live.reasons or live.reasons in told:
            return []
        told.append(live.reasons)
        assert RecordIndex(study).entries() == []
        bench.play(next(scripts))
        return [Told(Control.NEXT, {})]

    operator = SimpleNamespace(acts=acts)
    Session(study, Connection(open_line, clock), simulated_calibration(), operator, clock=clock).run()
    assert [reasons[0].split(":")[0] for reasons in told] == ["tether", "seat"]
    assert len(RecordIndex(study).entries()) == 1


def test_damaged_lines_fail_the_test_of_a_device(tmp_path):
    _, study = freeze_plan(declared(tmp_path, "trials = 1"))
    clock = SimulatedClock()
    line = SimulatedBench(clock).open_line()

    def read(timeout_s):
        received = line.read(timeout_s)
        return received._replace(data=received.data.replace(b"\r\n$", b"\r\nwhat a loose wire sends\r\n$"))

    noisy = SimpleNamespace(url=line.url, adapter=line.adapter, read=read, close=line.close)
    operator = SimpleNamespace(
        acts=lambda live: [Told(Control.STOP, {})] if live.reasons or live.state is State.SET_UP else []
    )
    seen = []
    Session(study, Connection(lambda: noisy, clock), simulated_calibration(), operator, seen.append, clock).run()
    assert State.SET_UP not in {live.state for live in seen}
    (reason,) = seen[-1].reasons
    assert reason.startswith("damaged lines")


def test_a_device_that_only_greets_fails_its_test(tmp_path):
    _, study = freeze_plan(declared(tmp_path, "trials = 1"))
    clock = SimulatedClock()
    greeting = hello_line(DEVICE, "1.0", 1, 100, [("tether", -8388608, 8388607), ("seat", -8388608, 8388607)])

    def read(timeout_s):
        now_ns = clock.monotonic_ns()
        return Received(greeting if now_ns // 10**7 % 100 == 0 else b"", now_ns, clock.wall_ns())

    line = SimpleNamespace(url="greeting:", adapter=AsciiStream(), read=read, close=lambda: None)
    pressed = {State.SELF_TEST: [Told(Control.STOP, {})]}
    operator = SimpleNamespace(acts=lambda live: pressed.get(live.state, []) if live.reasons else [])
    seen = []
    calibration = simulated_calibration()
    Session(study, Connection(lambda: line, clock), calibration, operator, seen.append, clock).run()
    assert {live.state for live in seen} == {State.WAITING, State.SELF_TEST, State.FINISHED}
    assert RecordIndex(study).entries() == []


def test_a_port_from_which_nothing_can_be_read_is_not_told_to_be_plugged_in(tmp_path):
    _, study = freeze_plan(declared(tmp_path, "trials = 1"))
    clock, seen = SimulatedClock(), []

    def read(timeout_s):
        now_ns = clock.monotonic_ns()
        return Received(b"" if now_ns // 10**7 % 2 else b"\xfe\x00\n", now_ns, clock.wall_ns())

    wrong = SimpleNamespace(url="wrong:", adapter=AsciiStream(), read=read, close=lambda: None)
    operator = SimpleNamespace(acts=lambda live: [Told(Control.STOP, {})] if len(seen) > 20 else [])
    connection = Connection(lambda: wrong, clock)
    Session(study, connection, simulated_calibration(), operator, seen.append, clock).run()
    assert seen[0].next.startswith("Plug in") and "--baud" in seen[-2].next
    assert {live.state for live in seen} == {State.WAITING, State.FINISHED}


@pytest.mark.parametrize("days", [31, -1])
def test_a_calibration_that_would_make_every_trial_unusable_is_told_before_the_first(tmp_path, days):
    _, study = freeze_plan(declared(tmp_path, "trials = 1"))
    clock, seen = SimulatedClock(), []
    calibration = simulated_calibration(datetime.now(UTC) - timedelta(days=days))
    operator = SimpleNamespace(
        acts=lambda live: [Told(Control.STOP, {})] if live.reasons or live.state is State.SET_UP else []
    )
    bench = SimulatedBench(clock)
    Session(study, Connection(bench.open_line, clock), calibration, operator, seen.append, clock).run()
    assert State.SET_UP not in {live.state for live in seen}
    (reason,) = seen[-1].reasons
    assert reason.startswith("calibration") and RecordIndex(study).entries() == []
