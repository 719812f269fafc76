"""A session at a terminal: live values in place, the outcome in large, the bell if asked for."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from typing import TextIO

from ...core.printable import printable
from ..outcome import Outcome
from .keys import KEYS, Keys
from .live import Live, State

_COLOURS = {Outcome.SUCCESS: "42;30", Outcome.FAILURE: "41;97", Outcome.UNUSABLE: "43;30"}
_BELLS = {Outcome.SUCCESS: 1, Outcome.FAILURE: 2, Outcome.UNUSABLE: 3}
_KEYS_OF = {
    State.WAITING: "q",
    State.SELF_TEST: "nq",
    State.SET_UP: "aq",
    State.ARMED: "sxmvq",
    State.RUNNING: "eixmvq",
    State.ENDED: "",
    State.JUDGED: "njmvq",
    State.FINISHED: "",
}
_WIDTH, _LARGE_WIDTH = 100, 60


class TerminalView:
    """Writes a session to ``stream``: a terminal is written over, elsewhere each state is a line.

    With ``bell`` an outcome is heard: once a success, twice a failure, three times an unusable trial.
    """

    def __init__(self, keys: Keys, bell: bool = False, stream: TextIO | None = None) -> None:
        self._keys, self._bell, self._stream = keys, bell, stream or sys.stdout
        self._is_terminal = self._stream.isatty()
        self._lines = 0
        self._told: tuple[State, int] | None = None

    def show(self, live: Live) -> None:
        """Write what is there now."""
        is_new = (live.state, live.record) != self._told
        self._told = live.state, live.record
        if self._is_terminal:
            width = shutil.get_terminal_size((_WIDTH, 24)).columns - 1  # a line that wraps is two
            told = map(printable, live_lines(live, self._keys.prompt))
            lines = [line for one in told for line in textwrap.wrap(one, width)]
            if live.state is State.JUDGED and live.outcome is not None:
                lines[:0] = _large(live.outcome, width)
            up = f"\x1b[{self._lines}A" if self._lines else ""
            self._stream.write(up + "\r\x1b[J" + "\n".join(lines) + "\n")
            self._lines = len(lines)
        elif is_new:
            self._stream.write(" | ".join(printable(line) for line in live_lines(live, "") if line) + "\n")
        if is_new and self._bell and live.state is State.JUDGED and live.outcome is not None:
            self._stream.write("\a" * _BELLS[live.outcome])
        self._stream.flush()


def live_lines(live: Live, prompt: str) -> list[str]:
    """A session's lines: the trial, its poses, the device, the counts, what to do and the keys."""
    tether = "tether on" if live.tethered else "tether off"
    record = f", record {live.record}" if live.record else ""
    simulated = " (simulated)" if live.simulated else ""
    trial = f"trial {live.index + 1} of {live.total}: {live.label}, repetition {live.repetition + 1}, {tether}{record}"
    lines = [
        f"{live.state.value.upper()}{simulated}  {trial}",
        f"robot {_pose(live.robot_pose)}   {live.chair} {_pose(live.chair_pose)}",
        _device(live),
    ]
    if live.state in (State.RUNNING, State.ENDED, State.JUDGED):
        lines.append(f"{live.elapsed_s:.1f} s, support {live.support_s:.1f} s")
    if live.outcome is not None and live.state is not State.RUNNING:
        lines.append(f"last trial: {live.outcome.value}  {'; '.join(live.reasons)}")
    if live.counts is not None:
        lines.append("   ".join(f"{one.condition}: {one.successes}/{one.trials}" for one in live.counts))
    lines.append(live.next)
    keys = "   ".join(f"[{key}] {KEYS[key][1]}" for key in _KEYS_OF[live.state])
    return [*lines, prompt or keys]


def _device(live: Live) -> str:
    loads = "   ".join(f"{name} {'-' if math.isnan(load) else f'{load:8.1f}'} N" for name, load in live.newtons)
    stop = "   EMERGENCY STOP" if live.emergency_stop else ""
    return f"{live.rate_hz:.0f} Hz, lost {100 * live.lost_share:.2f} %   {loads}{stop}"


def _pose(pose: tuple[float, float, float]) -> str:
    return f"x {pose[0]:+.2f} m, y {pose[1]:+.2f} m, {pose[2]:+.0f}°"


def _large(outcome: Outcome, width: int) -> list[str]:
    """Three lines of the outcome's colour."""
    word = "  ".join(outcome.value.upper()).center(min(width, _LARGE_WIDTH))[:width]
    return [f"\x1b[{_COLOURS[outcome]}m{text}\x1b[0m" for text in (" " * len(word), word, " " * len(word))]
