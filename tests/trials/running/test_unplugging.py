"""Unplugged at any state: what was being recorded is unusable and readable, and the next trial begins.

Over the state machine by chance, with a device in this process, and once at each state on a real terminal.
"""

import random
import sys
import threading

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from trials.declarations import declared

from r2sego_blender.trials.line.device import open_device
from r2sego_blender.trials.line.simulated import simulated_calibration, simulated_device
from r2sego_blender.trials.outcome import Outcome, Unusable
from r2sego_blender.trials.plan.study import freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.running.clock import MachineClock, SimulatedClock
from r2sego_blender.trials.running.connection import Connection
from r2sego_blender.trials.running.judged_record import judged_record
from r2sego_blender.trials.running.live import State
from r2sego_blender.trials.running.session import Session
from r2sego_blender.trials.running.simulated import SimulatedBench, SimulatedOperator

SHORT = "support_s = 2.0"
PATIENT = f"{SHORT}\nmax_silence_ms = 5000.0\nmax_drift = 0.1"
"""On a real terminal: a busy machine may read it late."""
RECORDED = (State.ARMED, State.RUNNING, State.ENDED)
STATES = (State.WAITING, State.SELF_TEST, State.SET_UP, *RECORDED, State.JUDGED)


class Careless:
    """An operator in whose way the cable is: it is drawn at each of ``pulls``, (state, seconds into it), in turn."""

    def __init__(self, operator, clock, unplug, pulls):
        self.operator, self.clock, self.unplug, self.pulls = operator, clock, unplug, list(pulls)
        self.state, self.since_ns = None, 0
        self.drawn = []
        """(state, record) at each time that the cable was drawn."""

    def acts(self, live):
        if live.state is not self.state:
            self.state, self.since_ns = live.state, self.clock.monotonic_ns()
        lasted_s = (self.clock.monotonic_ns() - self.since_ns) / 1e9
        if self.pulls and live.state is self.pulls[0][0] and lasted_s >= self.pulls[0][1]:
            self.pulls.pop(0)
            self.drawn.append((live.state, live.record))
            self.unplug()
            return []
        return self.operator.acts(live)


def checked(study, plan, drawn):
    """What has to hold of all that was recorded, however often the cable was drawn."""
    entries = RecordIndex(study).entries()
    cut = set()
    for entry in entries:
        record = read_record(study / "records" / entry.name)
        assert record.complete and record.finished
        assert judged_record(record) == entry.sensors
        kinds = {kind for kind, _ in entry.judgement.reasons}
        if record.lost_ns:
            cut.add(entry.number)
            assert entry.judgement.outcome is Outcome.UNUSABLE and Unusable.DISCONNECTED in kinds
        else:
            assert entry.judgement.outcome is Outcome.SUCCESS
    assert cut >= {record for state, record in drawn if state in RECORDED}
    usable = [entry.trial for entry in entries if entry.number not in cut]
    assert usable == list(range(len(plan.trials)))  # each was run again at once
    assert [entry.number for entry in entries] == list(range(1, len(entries) + 1))


@settings(max_examples=8, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])  # shrinking takes long
@given(st.lists(st.tuples(st.sampled_from(STATES), st.floats(0.0, 3.0)), max_size=6))
def test_whenever_the_cable_is_drawn_the_plan_comes_to_its_end(tmp_path_factory, pulls):
    plan, study = freeze_plan(declared(tmp_path_factory.mktemp("study"), "trials = 1", SHORT))
    clock = SimulatedClock()
    bench = SimulatedBench(clock, rate_hz=50)
    operator = SimulatedOperator(plan, bench, clock, lambda trial, tried: "success")
    lasting = {State.ARMED: 0.2, State.ENDED: 0.2, State.JUDGED: 0.2, State.SET_UP: 0.0, State.WAITING: 0.0}
    careless = Careless(
        operator, clock, bench.unplug, [(state, min(after_s, lasting.get(state, 1.5))) for state, after_s in pulls]
    )
    Session(study, Connection(bench.open_line, clock), simulated_calibration(), careless, clock=clock).run()
    checked(study, plan, careless.drawn)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no terminals of Unix")
def test_at_each_state_on_a_real_terminal(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", PATIENT))
    device = simulated_device("idle")
    moments = random.Random(39)
    pulls = [(state, 0.0 if state is State.SET_UP else moments.uniform(0.0, 0.15)) for state in STATES[1:]]

    def unplug():
        device.unplug()
        threading.Timer(moments.uniform(0.1, 1.0), device.plug_in).start()

    clock = MachineClock()
    with device as url:
        operator = SimulatedOperator(plan, device, clock, lambda trial, tried: "success")
        careless = Careless(operator, clock, unplug, pulls)
        Session(study, Connection(lambda: open_device(url), clock), simulated_calibration(), careless).run()
    assert [state for state, _ in careless.drawn] == [state for state, _ in pulls]
    checked(study, plan, careless.drawn)
