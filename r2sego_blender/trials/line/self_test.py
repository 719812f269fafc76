"""The test of a device before each session: at rest, does it behave as it was calibrated?"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np

from ..calibration.calibration import Calibration
from ..stream import Flags, Hello, Stream
from .adapters import GAUGE
from .decoding import Message, StreamBuilder

LASTS_S, LONGEST_S = 2.0, 10.0
"""By the device's clock; and by this machine's, after which a device that is not done sends too little."""

ZERO_N, NOISE_N, RATE_SHARE = 10.0, 2.0, 0.05
"""How far a channel may stand from no load (a slack tether weighs something), its standard deviation, and how far
the rate may be from the one that the device tells."""

ASKED_HZ = 25.0
"""The least of a gauge, which answers as quickly as it can: 40 ms between two samples are no gap yet."""

_FLAGS = {
    Flags.EMERGENCY_STOP: "the emergency circuit is open",
    Flags.SATURATED: "a channel is at an end of its range",
    Flags.SENSOR_FAULT: "a channel cannot be read",
}


class SelfTest:
    """Takes two seconds of what the device sends that said ``hello``, tether slack and seat empty.

    Without a ``calibration`` no loads are looked at. ``results`` are there once it is ``complete``.
    """

    def __init__(self, hello: Hello, calibration: Calibration | None) -> None:
        self._hello, self._calibration = hello, calibration
        self._builder = StreamBuilder(hello)

    def add(self, messages: Iterable[Message]) -> None:
        """Go on with what came, damaged lines too."""
        for message in messages:
            if not self.complete:
                self._builder.add([message], 0)  # how many lines are damaged counts, not when

    @property
    def complete(self) -> bool:
        """Whether it has seen enough."""
        return self._builder.lasts_us >= LASTS_S * 1e6

    @cached_property
    def results(self) -> tuple[tuple[str, str, bool], ...]:
        """What was looked at, what was measured, in words with units, and whether it is right."""
        stream = self._builder.stream()
        found = [*self._line(stream), *self._loads(stream)]
        flags = int(np.bitwise_or.reduce(stream.flags))
        told = ", ".join(words for flag, words in _FLAGS.items() if flags & flag)
        return (*found, ("flags", told or "none", not told))

    @property
    def problems(self) -> tuple[str, ...]:
        """What is not right, in words; none where the device may be used."""
        if not self.complete:
            return ("it sends too little, or its clock stands still",)
        return tuple(f"{what}: {measured}" for what, measured, right in self.results if not right)

    def _line(self, stream: Stream) -> Iterable[tuple[str, str, bool]]:
        steps = len(stream.sequence) - 1
        rate = steps / self._builder.lasts_us * 1e6
        told = self._hello.rate_hz
        if self._hello.device == GAUGE:
            yield "rate", f"{rate:.1f} Hz of {ASKED_HZ:g} Hz at least", rate >= ASKED_HZ
        else:
            yield "rate", f"{rate:.1f} Hz of {told:g} Hz", abs(rate / told - 1) <= RATE_SHARE
        missing = int(stream.sequence[-1] - stream.sequence[0]) - steps
        yield "missing samples", str(missing), missing == 0
        yield "restarts", str(len(stream.resets_ns)), not len(stream.resets_ns)
        yield "damaged lines", str(len(stream.damaged_ns)), not len(stream.damaged_ns)

    def _loads(self, stream: Stream) -> Iterable[tuple[str, str, bool]]:
        if self._calibration is None:
            return
        if not self._calibration.is_of(self._hello):
            yield "calibration", f"it is of {self._calibration.device} with its channels then", False
            return
        newtons = self._calibration.newtons(stream.raw)
        for channel, mean, noise in zip(stream.channels, newtons.mean(axis=0), newtons.std(axis=0), strict=True):
            words = f"{mean:+.2f} N, standard deviation {noise:.2f} N"
            yield channel.name, words, bool(abs(mean) <= ZERO_N and noise <= NOISE_N)
