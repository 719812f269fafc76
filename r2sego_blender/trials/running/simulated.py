"""A session without hardware or people: a device in this process and an operator, on a clock of their own."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Protocol

from ..judging.judge import TETHER
from ..line.adapters import AsciiStream
from ..line.device import LineLost, Received
from ..line.simulated import cell_arguments, script_named
from ..line.simulated_program import DeviceProgram, ProgramScript, cells_of
from ..plan.rules import Rules
from ..plan.trial_plan import PlannedTrial, TrialPlan
from ..stream import kind_of
from .clock import Clock
from .controls import Control, Told
from .live import Live, State

_PIECE_BYTES = 4096
_READY_S, _LONGER_S, _GIVES_UP_S = 0.3, 0.5, 6.0

PAPER_SUCCESSES = ((0, 0, 1, 2, 1), (7, 7, 7, 6, 6))
"""Of eight trials of each policy, by condition (Sec. "Real-Robot Sitting Validation")."""

_FAILURES = ("tether", "fall", "stop")
_DEFECTS = ("gap", "unplug", "reset", "loss", "saturation", "drift")
_DEFECT_EVERY = 12


class PlaysScripts(Protocol):
    """A simulated device."""

    def play(self, script: str, seed: int = 0) -> None:
        """Go on with a script, from its start."""
        ...


class SimulatedLine:
    """The line to the simulated device's own program, which runs as ``clock`` is turned."""

    url = "simulated:"
    adapter = AsciiStream()

    def __init__(self, clock: Clock, rate_hz: int, boot: int) -> None:
        self._clock, self._rate_hz = clock, rate_hz
        self._cells = cells_of(cell_arguments())
        self._program = DeviceProgram(rate_hz, boot, self._cells)
        self._begun_ns, self._ticks = clock.monotonic_ns(), 0
        self._sent = b""
        self._is_gone = False
        self.play("idle")

    def play(self, script: str, seed: int = 0) -> None:
        """Go on with a script, from its start."""
        self._program.play(ProgramScript.parse(script_named(script).line(seed), len(self._cells)))

    def read(self, timeout_s: float) -> Received:
        """What was sent until now. Raises LineLost once a script has unplugged it."""
        due = (self._clock.monotonic_ns() - self._begun_ns) * self._rate_hz // 1_000_000_000
        while self._ticks < due and not self._is_gone:
            self._ticks += 1
            sent = self._program.step()
            self._is_gone = sent is None
            self._sent += sent or b""
        if self._is_gone and not self._sent:
            raise LineLost("unplugged by its script", where=self.url)
        data, self._sent = self._sent[:_PIECE_BYTES], self._sent[_PIECE_BYTES:]
        return Received(data, self._clock.monotonic_ns(), self._clock.wall_ns())

    def unplug(self) -> None:
        """As its cable is drawn."""
        self._is_gone = True

    def close(self) -> None:
        """Nothing is held."""


class SimulatedBench:
    """A place for a simulated device: ``open_line`` plugs a new one in, ``play`` is for the one that is there."""

    def __init__(self, clock: Clock, rate_hz: int = 100) -> None:
        self._clock, self._rate_hz, self._boots = clock, rate_hz, 0
        self._line: SimulatedLine | None = None

    def open_line(self) -> SimulatedLine:
        """A device that has just been plugged in."""
        self._boots += 1
        self._line = SimulatedLine(self._clock, self._rate_hz, self._boots)
        return self._line

    def play(self, script: str, seed: int = 0) -> None:
        """Have the device that is plugged in play a script."""
        if self._line is not None:
            self._line.play(script, seed)

    def unplug(self) -> None:
        """Draw its cable; ``open_line`` plugs in another."""
        if self._line is not None:
            self._line.unplug()


class SimulatedOperator:
    """Does what a session asks for; as a policy is started, ``device`` plays what ``script_of`` says of its trial.

    ``script_of`` is given the planned trial and how often it was tried before.
    """

    def __init__(
        self, plan: TrialPlan, device: PlaysScripts, clock: Clock, script_of: Callable[[PlannedTrial, int], str]
    ) -> None:
        self._plan, self._device, self._clock, self._script_of = plan, device, clock, script_of
        self._tried: Counter[int] = Counter()
        self._since: tuple[State, int] = (State.WAITING, 0)

    def acts(self, live: Live) -> list[Told]:
        """What an operator would do now."""
        if self._since[0] is not live.state:
            self._since = live.state, self._clock.monotonic_ns()
        control = self._control(live, (self._clock.monotonic_ns() - self._since[1]) / 1e9)
        return [] if control is None else [Told(control, {})]

    def _control(self, live: Live, lasted_s: float) -> Control | None:
        rules = self._plan.rules
        if live.state is State.SET_UP:
            return Control.ARM
        if live.state is State.ARMED and lasted_s >= _READY_S:
            self._device.play(self._script_of(self._plan.trials[live.index], self._tried[live.index]), live.record)
            self._tried[live.index] += 1
            return Control.START
        if live.state is State.RUNNING and _is_over(live, rules):
            return Control.END
        if live.state in (State.JUDGED, State.SELF_TEST) and lasted_s >= _READY_S:
            if live.state is State.JUDGED:
                self._device.play("idle")
            return Control.NEXT
        return None


def _is_over(live: Live, rules: Rules) -> bool:
    tether = [load for name, load in live.newtons if kind_of(name) == TETHER]
    sits = live.support_s > 0.0
    return (
        live.support_s >= rules.support_s + _LONGER_S
        or sum(tether) > 2.0 * rules.tether_n
        or (live.elapsed_s >= _GIVES_UP_S and not sits)
        or live.elapsed_s >= _GIVES_UP_S + rules.support_s
    )


def simulated_scripts(plan: TrialPlan) -> Callable[[PlannedTrial, int], str]:
    """What happens at each trial of a plan: the paper's counts where it has the paper's shape, else by chance.

    Every twelfth trial's device has a defect the first time.
    """
    successes = _successes(plan)
    defects = {index: _DEFECTS[index // _DEFECT_EVERY % len(_DEFECTS)] for index in range(5, len(plan.trials), 12)}

    def script_of(trial: PlannedTrial, tried: int) -> str:
        if not tried and trial.index in defects:
            return defects[trial.index]
        succeeds = trial.repetition < successes[trial.condition, trial.policy_seed]
        return "success" if succeeds else _FAILURES[trial.index % len(_FAILURES)]

    return script_of


def _successes(plan: TrialPlan) -> Mapping[tuple[str, int], int]:
    """How many of each policy's trials succeed, its first ones."""
    trials = Counter((trial.condition, trial.policy_seed) for trial in plan.trials)
    if len(plan.conditions) == 2 and len(plan.seeds) == 5 and set(trials.values()) == {8}:
        return {
            (condition, seed): PAPER_SUCCESSES[row][column]
            for row, condition in enumerate(plan.conditions)
            for column, seed in enumerate(plan.seeds)
        }
    rng = random.Random(plan.seed)
    return {policy: rng.randint(0, count) for policy, count in trials.items()}
