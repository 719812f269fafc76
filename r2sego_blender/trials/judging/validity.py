"""Whether a recording can tell what the robot did: complete, in range, on one clock, calibrated."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..outcome import Unusable
from ..plan.rules import Rules
from ..stream import Flags, Stream

Reason = tuple[Unusable, str]

_LEAST_DRIFT_S = 1.0
"""Clocks are compared over this long at least, seconds: over less, the line's delays alone can tell 1 %."""

_PIECE_S = 5.0
"""A clock that drifts for as long as a support is found, too, in overlapping pieces of this length."""


def recording_problems(stream: Stream, began_ns: int, ended_ns: int, rules: Rules) -> Iterator[Reason]:
    """Why the recording of a trial between two times of the host's clock is unusable; nothing where it is not.

    All of the recording counts, what was sent before and after the trial too.
    """
    received, device_us, sequence = stream.received_ns, stream.device_us, stream.sequence
    if len(stream.lost_ns):
        yield Unusable.DISCONNECTED, f"line lost {len(stream.lost_ns)} times"
    if len(stream.resets_ns):
        yield Unusable.RESET, f"device began anew {len(stream.resets_ns)} times"
    within = (received >= began_ns) & (received <= ended_ns)
    if not within.any():
        yield Unusable.SILENCE, "no sample between start and end"
        return
    # Before the first sample and after the last one there are none as well.
    heard = np.r_[began_ns, received[within], ended_ns]
    silence_ms = max(_highest(np.diff(heard)), _highest(np.diff(received))) / 1e6
    if silence_ms > rules.max_silence_ms:
        yield Unusable.SILENCE, f"{silence_ms:.1f} ms without a sample"
    gaps = np.diff(device_us)
    if len(gaps) and (gaps.min() <= 0 or np.diff(received).min() < 0):
        yield Unusable.GAP, "samples out of order"
    elif _highest(gaps) > rules.max_gap_ms * 1e3:
        yield Unusable.GAP, f"{_highest(gaps) / 1e3:.1f} ms between two samples"
    if len(sequence) > 1 and np.diff(sequence).min() <= 0:
        yield Unusable.LOSS, "numbers out of order"
    else:
        loss = max(_loss(sequence), _loss(sequence[within]))
        if loss > rules.max_loss:
            yield Unusable.LOSS, f"{100 * loss:.3f} % of the samples missing"
    drift = max((_drift(device_us[piece], received[piece]) for piece in _pieces(received, within)), key=abs)
    if abs(drift) > rules.max_drift:
        yield Unusable.CLOCK_DRIFT, f"device's clock {100 * drift:+.2f} % off"
    yield from _out_of_range(stream)


def _out_of_range(stream: Stream) -> Iterator[Reason]:
    lowest = np.array([channel.lowest for channel in stream.channels], np.int64)
    highest = np.array([channel.highest for channel in stream.channels], np.int64)
    at_end = ((stream.raw <= lowest) | (stream.raw >= highest)).any(axis=0)
    names = ", ".join(channel.name for channel, hit in zip(stream.channels, at_end, strict=True) if hit)
    if names or (stream.flags & Flags.SATURATED).any():
        yield Unusable.SATURATION, f"{names or 'a channel'} at an end of the range"
    if faults := int(((stream.flags & Flags.SENSOR_FAULT) != 0).sum()):
        yield Unusable.SENSOR_FAULT, f"{faults} samples without a reading"


def _loss(sequence: np.ndarray) -> float:
    if len(sequence) < 2:
        return 0.0
    sent = int(sequence[-1] - sequence[0]) + 1
    return 1.0 - len(sequence) / sent


def _pieces(received_ns: np.ndarray, within: np.ndarray) -> Iterator[np.ndarray | slice]:
    """The whole recording, the trial, and pieces of the recording that overlap by half, the last at its end."""
    yield slice(None)
    yield within
    for begin in np.arange(received_ns[0], received_ns[-1], _PIECE_S / 2 * 1e9):
        first = int(min(begin, max(received_ns[-1] - _PIECE_S * 1e9, received_ns[0])))
        yield slice(*np.searchsorted(received_ns, [first, first + int(_PIECE_S * 1e9)]).tolist())


def _drift(device_us: np.ndarray, received_ns: np.ndarray) -> float:
    """How much faster the device's clock runs than the host's, as a share; 0 where too little tells it.

    Of the first and of the last third the sample that was least delayed stands for its time.
    """
    if len(device_us) < 3:
        return 0.0
    device_s = (device_us - device_us[0]) / 1e6
    host_s = (received_ns - received_ns[0]) / 1e9
    span = host_s[-1]
    if not span >= _LEAST_DRIFT_S:
        return 0.0
    delay = host_s - device_s
    early, late = np.flatnonzero(host_s <= span / 3), np.flatnonzero(host_s >= 2 * span / 3)
    first, last = early[delay[early].argmin()], late[delay[late].argmin()]
    passed = float(host_s[last] - host_s[first])
    return float(device_s[last] - device_s[first]) / passed - 1.0 if passed > 0.0 else math.inf


def _highest(differences: np.ndarray) -> float:
    return float(differences.max()) if len(differences) else 0.0
