"""What comes over the line at this moment, for the operator's eyes: judging is done from the record."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..calibration.calibration import Calibration
from ..judging.judge import SEAT
from ..line.decoding import Sample
from ..line.framing import SEQUENCES
from ..stream import Flags, Hello, kind_of

_WINDOW_NS = 1_000_000_000
_MOST_BATCHES = 1000


@dataclass(frozen=True)
class _Batch:
    received_ns: int
    count: int
    sent: int


class Monitor:
    """Rate and loss of the last second, the latest loads, and how long the seat has borne one."""

    def __init__(self, calibration: Calibration | None, seat_n: float) -> None:
        self._calibration, self._seat_n = calibration, seat_n
        self._batches: deque[_Batch] = deque(maxlen=_MOST_BATCHES)
        self._last: int | None = None
        self._seated_ns: int | None = None
        self.newtons: tuple[tuple[str, float], ...] = ()
        self.emergency_stop = False

    def add(self, samples: Sequence[Sample], hello: Hello) -> None:
        """Take the samples of a moment."""
        if not samples or len(samples[-1].raw) != len(hello.channels):
            return
        last = samples[-1]
        before = self._last if self._last is not None else samples[0].sequence - 1
        self._batches.append(_Batch(last.received_ns, len(samples), (last.sequence - before) % SEQUENCES))
        self._last = last.sequence
        self.emergency_stop = bool(last.flags & Flags.EMERGENCY_STOP)
        names = [channel.name for channel in hello.channels]
        self.newtons = tuple(zip(names, self._loads(samples, hello), strict=True))
        seat = [load for name, load in self.newtons if kind_of(name) == SEAT]
        if not seat or not sum(seat) >= self._seat_n:
            self._seated_ns = None
        elif self._seated_ns is None:
            self._seated_ns = samples[0].received_ns

    def reset(self) -> None:
        """The line was lost: what was heard before is not of this moment."""
        self._batches.clear()
        self._last = self._seated_ns = None
        self.newtons, self.emergency_stop = (), False

    def rate(self, now_ns: int) -> tuple[float, float]:
        """Samples a second and the share of those sent that were lost, over the last second."""
        while self._batches and self._batches[0].received_ns < now_ns - _WINDOW_NS:
            self._batches.popleft()
        count, sent = sum(one.count for one in self._batches), sum(one.sent for one in self._batches)
        return float(count), max(0.0, 1.0 - count / sent) if sent else 0.0

    def supported_s(self, now_ns: int) -> float:
        """How long the seat has borne the robot by now, seconds."""
        return 0.0 if self._seated_ns is None else max(0.0, (now_ns - self._seated_ns) / 1e9)

    def _loads(self, samples: Sequence[Sample], hello: Hello) -> list[float]:
        calibration = self._calibration
        if calibration is None or len(calibration.channels) != len(hello.channels):
            return [math.nan] * len(hello.channels)
        same = [sample.raw for sample in samples if len(sample.raw) == len(hello.channels)]
        mean = [sum(counts) / len(same) for counts in zip(*same, strict=True)]  # quicker than an array of so few
        return [float(load) for load in calibration.newtons(np.array([mean]))[0]]
