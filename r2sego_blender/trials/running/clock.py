"""The clocks of a session: this machine's, or one that a simulated device turns."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """What a session takes its times from."""

    def monotonic_ns(self) -> int:
        """The clock that stamps samples and events."""
        ...

    def wall_ns(self) -> int:
        """Nanoseconds since 1970, UTC."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        ...


class MachineClock:
    """This machine's clocks."""

    def monotonic_ns(self) -> int:
        return time.monotonic_ns()

    def wall_ns(self) -> int:
        return time.time_ns()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class SimulatedClock:
    """Turned by ``sleep`` alone, so that an hour of simulated trials takes as long as its computing."""

    def __init__(self, monotonic_ns: int = 1_000_000_000, wall_ns: int | None = None) -> None:
        self._monotonic_ns = monotonic_ns
        self._ahead_ns = (time.time_ns() if wall_ns is None else wall_ns) - monotonic_ns

    def monotonic_ns(self) -> int:
        return self._monotonic_ns

    def wall_ns(self) -> int:
        return self._monotonic_ns + self._ahead_ns

    def sleep(self, seconds: float) -> None:
        self._monotonic_ns += round(seconds * 1e9)
