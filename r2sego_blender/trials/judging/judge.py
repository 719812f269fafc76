"""What a trial ended in, from its record alone: the same stream is judged the same, whenever and wherever."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..calibration.calibration import Calibration
from ..events import EventKind, TrialEvent
from ..outcome import Failure, Judgement, Outcome, Unusable
from ..plan.rules import Rules
from ..stream import Channel, Flags, Stream, kind_of
from .support import longest_support
from .validity import recording_problems

TETHER, SEAT = "tether", "seat"
"""Kinds of channels; several of one kind bear together."""


def judge(stream: Stream, events: Sequence[TrialEvent], calibration: Calibration | None, rules: Rules) -> Judgement:
    """Whether the robot sat down by itself: no intervention, no load on the tether, stable support long enough.

    Whether the recording can tell it comes first: one that cannot is unusable whatever it shows, and its reasons
    say what else was seen. The trial lasts from the first event ``STARTED`` to the first ``ENDED``;
    ``calibration`` is the one of the device that sent ``stream``, None without any.
    """
    started = next((event for event in events if event.kind is EventKind.STARTED), None)
    ended = next((event for event in events if event.kind is EventKind.ENDED), None)
    if started is None or (ended is not None and ended.time_ns <= started.time_ns):
        lost = ((Unusable.DISCONNECTED, "line lost"),) if len(stream.lost_ns) else ()
        told = ", ".join(("never started", *(one.text for one in events if one.kind is EventKind.ABORTED and one.text)))
        return Judgement(Outcome.UNUSABLE, (*lost, (Unusable.ABORTED, told)), 0.0, math.nan)
    last_ns = int(stream.received_ns.max(initial=started.time_ns))
    ended_ns = last_ns if ended is None else ended.time_ns
    unusable = [] if ended else [(Unusable.CUT_OFF, "the record breaks off")]
    aborted = [event for event in events if event.kind is EventKind.ABORTED and event.time_ns <= ended_ns]
    unusable += [(Unusable.ABORTED, event.text) for event in aborted]
    unusable += recording_problems(stream, started.time_ns, ended_ns, rules)

    within = (stream.received_ns >= started.time_ns) & (stream.received_ns <= ended_ns)
    tether, seat, problem = _loads(stream, within, calibration, started.wall_ns / 1e9, rules)
    if problem:
        unusable.append((Unusable.CALIBRATION, problem))
    time_us = _since(started.time_ns, stream, within)
    support_us, complete_us = longest_support(
        time_us, seat, rules.seat_n, rules.stability, round(rules.support_s * 1e6)
    )
    failures = list(_seen(stream, events, started.time_ns, ended_ns, within))
    bearing = np.flatnonzero(tether > rules.tether_n)
    highest_n = float(tether.max()) if len(tether) else math.nan
    if len(bearing):
        failures.append((time_us[bearing[0]] / 1e6, Failure.TETHER, f"{highest_n:.1f} N"))
    reasons = [
        (kind, f"{text + ', ' if text else ''}at {at_s:.2f} s") for at_s, kind, text in sorted(failures, key=_at)
    ]
    if not reasons:
        reasons += _unsupported(support_us / 1e6, complete_us, (ended_ns - started.time_ns) / 1e9, rules)
    outcome = Outcome.UNUSABLE if unusable else Outcome.FAILURE if reasons else Outcome.SUCCESS
    return Judgement(outcome, (*unusable, *reasons), support_us / 1e6, highest_n)


def calibration_problem(
    calibration: Calibration | None, channels: Sequence[Channel], now_s: float, rules: Rules
) -> str:
    """Why no trial that begins ``now_s`` seconds after 1970 can be judged by a calibration; "" where it can."""
    if calibration is None:
        return "none"
    if not calibration.measures(channels):
        return "of other channels"
    age = calibration.age_days(now_s)
    if not 0.0 <= age <= rules.calibration_days:
        return f"{age:.1f} days old"
    kinds = {kind_of(channel.name) for channel in channels}
    return "" if {TETHER, SEAT} <= kinds else f"it tells no load at {TETHER} and {SEAT}"


Seen = tuple[float, Failure, str]
"""Seconds since the start, what was seen, and words to it."""


def _at(seen: Seen) -> float:
    return seen[0]


def _seen(
    stream: Stream, events: Sequence[TrialEvent], began_ns: int, ended_ns: int, within: np.ndarray
) -> Iterator[Seen]:
    """What the operator did, and the emergency circuit."""
    kinds = {EventKind.INTERVENTION: Failure.INTERVENTION, EventKind.EMERGENCY_STOP: Failure.EMERGENCY_STOP}
    for event in events:
        if event.kind in kinds and began_ns <= event.time_ns <= ended_ns:
            yield (event.time_ns - began_ns) / 1e9, kinds[event.kind], event.text
    pressed = stream.received_ns[within & ((stream.flags & Flags.EMERGENCY_STOP) != 0)]
    if len(pressed):
        yield (int(pressed[0]) - began_ns) / 1e9, Failure.EMERGENCY_STOP, "button"


def _unsupported(support_s: float, complete_us: int | None, lasted_s: float, rules: Rules) -> list[tuple[Failure, str]]:
    words = f"longest support {support_s:.3f} s of {rules.support_s:g} s"
    if complete_us is None:
        kind = Failure.TIMEOUT if lasted_s >= rules.timeout_s else Failure.NO_SUPPORT
        return [(kind, words)]
    late = complete_us > rules.timeout_s * 1e6
    return [(Failure.TIMEOUT, f"supported only after {complete_us / 1e6:.2f} s")] if late else []


def _loads(
    stream: Stream, within: np.ndarray, calibration: Calibration | None, now_s: float, rules: Rules
) -> tuple[np.ndarray, np.ndarray, str]:
    """Newtons at the tether and on the seat, (n,) each, and why they cannot be trusted; NaN where nothing tells."""
    unknown = np.full(int(within.sum()), np.nan)
    problem = calibration_problem(calibration, stream.channels, now_s, rules)
    if calibration is None or not calibration.measures(stream.channels):
        return unknown, unknown, problem
    loads = calibration.newtons(stream.raw[within])
    names = [channel.name for channel in stream.channels]
    tether, seat = (_together(loads, names, kind) for kind in (TETHER, SEAT))
    return tether, seat, problem


def _together(loads: np.ndarray, names: Sequence[str], kind: str) -> np.ndarray:
    """The sum of the channels of a kind; NaN without any."""
    ours = [index for index, name in enumerate(names) if kind_of(name) == kind]
    return loads[:, ours].sum(axis=1) if ours else np.full(len(loads), np.nan)


def _since(began_ns: int, stream: Stream, within: np.ndarray) -> np.ndarray:
    """Microseconds since the start (n,) int64: the device's clock, set by the first sample's reception."""
    device_us = stream.device_us[within]
    first_us: np.ndarray = (stream.received_ns[within][:1] - began_ns) // 1000
    return np.asarray(device_us - device_us[:1] + first_us)
