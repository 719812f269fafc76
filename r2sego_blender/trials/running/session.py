"""A session: the trials of a plan, one after the other, until none is left or the operator stops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from ...core.errors import TrialError
from ..calibration.calibration import Calibration
from ..judging.judge import calibration_problem
from ..line.decoding import Sample
from ..line.self_test import LONGEST_S, SelfTest
from ..line.simulated import DEVICE
from ..outcome import Judgement, Outcome
from ..plan.next_trial import is_tethered, next_trial
from ..plan.study import begin_study, state_of
from ..plan.trial_plan import PlannedTrial, TrialPlan
from ..records.index import Entry, RecordIndex
from .about import About
from .clock import Clock, MachineClock
from .connection import Connection, Heard
from .controls import Control, Told
from .live import Counts, Live, State
from .monitor import Monitor
from .session_lock import alone
from .trial import Trial

TICK_S = 0.04
"""How often a session looks at its line and its operator."""

_WORDS = {
    State.ARMED: "Recording. Start the policy, and say so.",
    State.RUNNING: "The policy runs. End the trial once it sits or has failed; say where you helped it.",
    State.ENDED: "Wait.",
    State.JUDGED: "Judged. On to the next trial, or stop.",
}
_SHOW_NS = 100_000_000


class Operator(Protocol):
    """Who sees a session and acts: a person at a terminal or in Blender, or a simulated one."""

    def acts(self, live: Live) -> list[Told]:
        """What they have done since they were last asked, in its order; ``live`` is what they can see."""
        ...


class Session:
    """The trials of the study in ``folder``, with a calibrated device; ``show`` is called ten times a second.

    Raises TrialError: there is no plan, or it was ended.
    """

    def __init__(
        self,
        folder: Path,
        connection: Connection,
        calibration: Calibration | None,
        operator: Operator,
        show: Callable[[Live], None] = lambda live: None,
        clock: Clock | None = None,
    ) -> None:
        self.plan = TrialPlan.load(folder)
        self._folder, self._index = folder, RecordIndex(folder)
        self._connection, self._calibration = connection, calibration
        self._operator, self._show, self._clock = operator, show, clock or MachineClock()
        self._monitor = Monitor(calibration, self.plan.rules.seat_n)
        self._entries = self._read_entries()
        self._counts = self._counted()
        self._judgement: Judgement | None = None  # the last trial's
        self._reasons: tuple[str, ...] = ()
        self._trial: Trial | None = None
        self._tested = False
        self._stopping = False
        self._shown: tuple[State, int] | None = None
        self._shown_ns = 0
        if state_of(folder).ended:
            raise TrialError("this study was ended", where=folder, cure="Plan another one.")

    def run(self) -> None:
        """Run trials until each has a usable recording, or until the operator stops.

        Raises TrialError, as where simulated trials and real ones would stand in one study, and OSError.
        Whatever ends it, records stay readable, and the next session goes on behind them.
        """
        with alone(self._folder):
            try:
                while not self._stopping and (planned := self._next()) is not None:
                    if self._is_set_up(planned):
                        self._run(planned)
                self._tell(self._next() or self.plan.trials[-1], State.FINISHED, "")
            finally:
                self._connection.close()

    def _next(self) -> PlannedTrial | None:
        return next_trial(self.plan, [entry.ended for entry in self._entries])

    def _is_set_up(self, planned: PlannedTrial) -> bool:
        """Wait for the device, test it, have the poses set up; whether the trial may be recorded now."""
        return self._wait(planned) and self._test(planned) and self._set_up(planned)

    def _wait(self, planned: PlannedTrial) -> bool:
        while self._connection.hello is None and not self._stopping:
            silent = (
                "The port is open; wait until the device says what it is, or see to its port, --baud and --adapter."
            )
            words = silent if self._connection.line is not None else "Plug in the device."
            self._tick(planned, State.WAITING, self._connection.problem or words)
        if self._connection.hello is not None and any(one.simulated != self._is_simulated for one in self._entries):
            raise TrialError(
                "simulated trials and real ones do not stand in one study",
                where=self._folder,
                cure="Plan another study for the one or the other.",
            )
        return not self._stopping

    @property
    def _is_simulated(self) -> bool:
        """Whether the device says that it is none."""
        hello = self._connection.hello
        return hello is not None and hello.device == DEVICE

    def _test(self, planned: PlannedTrial) -> bool:
        """The device's self-test, once after each time that it was plugged in or began anew."""
        while not self._tested and not self._stopping:
            assert self._connection.hello is not None
            test = SelfTest(self._connection.hello, self._calibration)
            until_ns = self._clock.monotonic_ns() + round(LONGEST_S * 1e9)
            while not test.complete and self._clock.monotonic_ns() < until_ns:
                heard, _ = self._tick(planned, State.SELF_TEST, "Leave the tether slack and the chair empty.")
                if heard.lost or self._stopping:
                    return False
                test.add(heard.messages)
            self._reasons = problems = (*test.problems, *self._calibration_problems())
            self._tested = again = not problems
            while not again and not self._stopping:
                words = f"The self-test failed: {'; '.join(problems)}. Mend it, then go on to the next test."
                heard, acts = self._tick(planned, State.SELF_TEST, words)
                if heard.lost:
                    return False
                again = any(told.control is Control.NEXT for told in acts)
        return not self._stopping

    def _calibration_problems(self) -> list[str]:
        """Why every trial would be unusable, told before anybody stands beside a robot for it."""
        calibration, hello = self._calibration, self._connection.hello
        if calibration is None or hello is None or not calibration.is_of(hello):  # the test tells another device
            return []
        problem = calibration_problem(calibration, hello.channels, self._clock.wall_ns() / 1e9, self.plan.rules)
        return [f"calibration: {problem}"] if problem else []

    def _set_up(self, planned: PlannedTrial) -> bool:
        tether = "on" if self._is_tethered(planned) else "off"
        words = f"Set up robot and chair as shown, the tether {tether}; then arm."
        while not self._stopping:
            heard, acts = self._tick(planned, State.SET_UP, words)
            if heard.lost or not self._tested:
                return False
            if any(told.control is Control.ARM for told in acts):
                return True
        return False

    def _run(self, planned: PlannedTrial) -> None:
        """Record a trial and have it judged."""
        line, hello = self._connection.line, self._connection.hello
        if line is None or hello is None:
            return
        begin_study(self._folder, self.plan)
        tethered = self._is_tethered(planned)
        number = self._index.begin(planned.index, self.plan.digest, tethered, self._is_simulated)
        about = About(
            number,
            self.plan.digest,
            planned,
            tethered,
            self.plan.rules,
            self._calibration,
            line.adapter,
            hello,
            line.url,
            self._is_simulated,
        )
        trial = self._trial = Trial(about, self._index, self._clock, self._connection.rest)
        going_on = False
        while not going_on:
            heard, acts = self._tick(planned, trial.state, f"{trial.refused} {_WORDS[trial.state]}".lstrip())
            trial.hear(heard)
            for told in acts:
                going_on |= trial.state is State.JUDGED and told.control in (Control.NEXT, Control.STOP)
                trial.tell(told)
            going_on |= self._stopping and trial.state is State.JUDGED
            self._refresh(trial)
        trial.close()
        self._trial = None

    def _refresh(self, trial: Trial) -> None:
        """Take over a trial's judgement where it has a new one."""
        if trial.judgement is not self._judgement and trial.judgement is not None:
            self._judgement, self._entries = trial.judgement, self._read_entries()
            self._counts = self._counted()
            self._reasons = tuple(f"{kind.value}: {text}" for kind, text in trial.judgement.reasons)

    def _read_entries(self) -> list[Entry]:
        entries = self._index.entries()
        if any(entry.plan != self.plan.digest or entry.trial >= len(self.plan.trials) for entry in entries):
            raise TrialError(
                "this index has records of another plan", where=self._index.file, cure="Restore it from a copy."
            )
        return entries

    def _tick(self, planned: PlannedTrial, state: State, words: str) -> tuple[Heard, list[Told]]:
        """Listen for a moment, show what is there, and ask what the operator did."""
        before = self._connection.hello
        heard = self._connection.hear(TICK_S)
        if self._connection.hello is not None:
            self._tested &= before is None or before.boot == self._connection.hello.boot
            samples = [message for message in heard.messages if isinstance(message, Sample)]
            self._monitor.add(samples, self._connection.hello)
        if heard.lost:
            self._monitor.reset()
            self._tested = False
        acts = self._operator.acts(self._tell(planned, state, words))
        self._stopping |= any(told.control is Control.STOP for told in acts)
        return heard, acts

    def _tell(self, planned: PlannedTrial, state: State, words: str) -> Live:
        now_ns = self._clock.monotonic_ns()
        rate_hz, lost_share = self._monitor.rate(now_ns)
        trial = self._trial
        live = Live(
            state=state,
            next=words,
            index=planned.index,
            total=len(self.plan.trials),
            label=planned.label,
            repetition=planned.repetition,
            tethered=self._is_tethered(planned) if trial is None else trial.about.tethered,
            robot_pose=planned.robot_pose.values,
            chair_pose=planned.chair_pose.values,
            chair=planned.chair,
            record=0 if trial is None else trial.about.number,
            newtons=self._monitor.newtons,
            rate_hz=rate_hz,
            lost_share=lost_share,
            emergency_stop=self._monitor.emergency_stop,
            elapsed_s=0.0 if trial is None else trial.elapsed_s,
            support_s=self._supported_s(state, now_ns),
            outcome=None if self._judgement is None else self._judgement.outcome,
            reasons=self._reasons,
            counts=None if self.plan.blinded else self._counts,
            simulated=self._is_simulated,
        )
        if (state, live.record) != self._shown or now_ns - self._shown_ns >= _SHOW_NS:
            self._shown = state, live.record
            self._shown_ns = max(self._shown_ns + _SHOW_NS, now_ns - _SHOW_NS)  # ticks are no divisor of it
            self._show(live)
        return live

    def _supported_s(self, state: State, now_ns: int) -> float:
        """The support so far; of a judged trial the one that was judged."""
        judged = None if self._trial is None else self._trial.judgement
        if judged is not None:
            return judged.support_s
        return self._monitor.supported_s(now_ns) if state is State.RUNNING else 0.0

    def _is_tethered(self, planned: PlannedTrial) -> bool:
        return is_tethered(planned, self.plan, [entry.ended for entry in self._entries])

    def _counted(self) -> tuple[Counts, ...]:
        found: Counter[tuple[str, Outcome]] = Counter(
            (self.plan.trials[entry.trial].condition, entry.judgement.outcome) for entry in self._entries
        )
        return tuple(
            Counts(
                condition,
                found[condition, Outcome.SUCCESS],
                found[condition, Outcome.SUCCESS] + found[condition, Outcome.FAILURE],
                found[condition, Outcome.UNUSABLE],
            )
            for condition in self.plan.conditions
        )
