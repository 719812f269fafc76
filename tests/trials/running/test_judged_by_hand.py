"""A person's judgement at a session: a mistyped one ends nothing, a right one counts and names its giver."""

from trials.declarations import declared

from r2sego_blender.trials.events import EventKind
from r2sego_blender.trials.line.simulated import simulated_calibration
from r2sego_blender.trials.outcome import Outcome
from r2sego_blender.trials.plan.study import freeze_plan
from r2sego_blender.trials.records.index import RecordIndex
from r2sego_blender.trials.records.reading import read_record
from r2sego_blender.trials.running.clock import SimulatedClock
from r2sego_blender.trials.running.connection import Connection
from r2sego_blender.trials.running.controls import Control, Told
from r2sego_blender.trials.running.live import State
from r2sego_blender.trials.running.session import Session
from r2sego_blender.trials.running.simulated import SimulatedBench, SimulatedOperator

GIVEN = (
    {"outcome": "succes", "by": "A. B.", "text": "mistyped"},
    {"outcome": "failure", "by": " ", "text": "nobody's"},
    {"outcome": "failure", "by": "A. B.", "text": "sat on the edge"},
)


class Judges:
    """Tells what is ``left`` once the first trial is judged, then stops; all else is another operator's."""

    def __init__(self, operator):
        self.operator, self.left, self.seen = operator, [Told(Control.JUDGE, one) for one in GIVEN], []

    def acts(self, live):
        if live.state is not State.JUDGED:
            return self.operator.acts(live)
        self.seen.append(live)
        return [self.left.pop(0) if self.left else Told(Control.STOP, {})]


def test_calling_off_a_trial_that_came_to_its_end_meanwhile_is_told_and_noted(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    clock = SimulatedClock()
    bench = SimulatedBench(clock)
    judges = Judges(SimulatedOperator(plan, bench, clock, lambda trial, tried: "fall"))
    judges.left = [Told(Control.ABORT, {"text": "not charged"})]
    Session(study, Connection(bench.open_line, clock), simulated_calibration(), judges, clock=clock).run()
    (entry,) = RecordIndex(study).entries()
    assert entry.judgement.outcome is Outcome.FAILURE
    before, told = judges.seen
    assert told.next != before.next and told.next.endswith(before.next)
    noted = read_record(study / "records" / entry.name).events[-1]
    assert (noted.kind, noted.text) == (EventKind.NOTE, "not charged")


def test_a_mistyped_judgement_is_told_and_ends_no_session(tmp_path):
    plan, study = freeze_plan(declared(tmp_path, "trials = 1", "support_s = 2.0"))
    clock = SimulatedClock()
    bench = SimulatedBench(clock)
    judges = Judges(SimulatedOperator(plan, bench, clock, lambda trial, tried: "success"))
    Session(study, Connection(bench.open_line, clock), simulated_calibration(), judges, clock=clock).run()
    (entry,) = RecordIndex(study).entries()
    assert (entry.sensors.outcome, entry.judgement.outcome) == (Outcome.SUCCESS, Outcome.FAILURE)
    assert "A. B." in entry.judgement.manual and entry.sha256
    before, mistyped, nobodys, judged = judges.seen
    assert [live.outcome for live in judges.seen] == [Outcome.SUCCESS] * 3 + [Outcome.FAILURE]
    assert "succes" in mistyped.next and len({before.next, mistyped.next, nobodys.next}) == 3
    assert judged.next == before.next
    assert all(live.support_s == entry.sensors.support_s for live in judges.seen)
