"""Zero and span of load cells, fitted to known weights, and the file that keeps them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from statistics import linear_regression
from typing import Any

import numpy as np

from ...core.atomic_files import write_whole
from ...core.errors import TrialError
from ...core.json_files import finite_number, opened_json
from ..stream import Channel, Hello

STANDARD_GRAVITY = 9.80665
"""m/s^2, by which weights in kilograms are newtons."""

_FORMAT = 1
_LEAST_LOAD_N = 0.01
_LEAST_SPAN = 10.0  # counts, between no load and the largest
_MOST_POINTS, _MOST_CHANNELS = 100, 8
_CURE = "Calibrate again with `r2sego trials calibrate`."


@dataclass(frozen=True)
class Point:
    """One known load on a channel: ``newtons``, the mean of its ``counts`` and their standard deviation."""

    newtons: float
    counts: float
    spread: float


@dataclass(frozen=True)
class ChannelCalibration:
    """One ``channel`` and the straight line through its ``points``, by least squares.

    Raises TrialError where the points make no line: fewer than two loads, or counts that do not follow them.
    """

    channel: Channel
    points: tuple[Point, ...]

    def __post_init__(self) -> None:
        loads = [point.newtons for point in self.points]
        if max(loads, default=0.0) - min(loads, default=0.0) < _LEAST_LOAD_N:
            raise TrialError(
                f"channel {self.channel.name} has fewer than two different loads",
                cure="Zero and one known weight are the least; a third shows whether the cell is straight.",
            )
        if not abs(self.counts_per_newton) * (max(loads) - min(loads)) >= _LEAST_SPAN:
            raise TrialError(
                f"channel {self.channel.name} hardly changes with its load",
                cure="See that the weights hang on this cell, and that it is wired to the channel of its name.",
            )

    @cached_property
    def _line(self) -> tuple[float, float]:
        slope, zero = linear_regression([one.newtons for one in self.points], [one.counts for one in self.points])
        return slope, zero

    @property
    def counts_per_newton(self) -> float:
        """The span; negative for a cell that hangs the other way."""
        return self._line[0]

    @property
    def zero(self) -> float:
        """Counts without load."""
        return self._line[1]

    @property
    def residuals_n(self) -> tuple[float, ...]:
        """By how many newtons each point lies off the line."""
        return tuple((one.counts - self.zero) / self.counts_per_newton - one.newtons for one in self.points)


@dataclass(frozen=True)
class Calibration:
    """The calibrated ``channels`` of a ``device``, in its order, and when they were ``taken`` (UTC)."""

    device: str
    firmware: str
    taken: datetime
    channels: tuple[ChannelCalibration, ...]

    @staticmethod
    def load(path: Path) -> Calibration:
        """Read a calibration. Raises TrialError: it is not there, damaged, or its points make no line."""
        with opened_json(path, TrialError, "this calibration cannot be read", _CURE) as record:
            try:
                return Calibration.of_values(record)
            except TrialError as error:
                raise TrialError(error.what, where=path, cure=error.cure) from error

    @staticmethod
    def of_values(record: Any) -> Calibration:
        """Of what a file holds, or a trial's record.

        Raises TrialError where its points make no line, LookupError, TypeError and ValueError for other damage.
        """
        if record["format"] != _FORMAT:
            raise ValueError("another format")
        channels = record["channels"]
        if not 1 <= len(channels) <= _MOST_CHANNELS or any(len(one["points"]) > _MOST_POINTS for one in channels):
            raise ValueError("too much of it")
        taken = datetime.fromisoformat(record["taken"])
        if taken.tzinfo is None:
            raise ValueError("a time without its zone")
        return Calibration(
            _word(record["device"]),
            _word(record["firmware"]),
            taken.astimezone(UTC),
            tuple(_channel(one) for one in channels),
        )

    def to_values(self) -> dict[str, Any]:
        """JSON values, of which ``of_values`` makes it again."""
        return {
            "format": _FORMAT,
            "device": self.device,
            "firmware": self.firmware,
            "taken": self.taken.isoformat(timespec="seconds"),
            "channels": [
                {
                    "name": one.channel.name,
                    "lowest": one.channel.lowest,
                    "highest": one.channel.highest,
                    "points": [vars(point) for point in one.points],
                }
                for one in self.channels
            ],
        }

    def save(self, path: Path) -> None:
        """Write it, whole or not at all."""
        write_whole(path, self._text)

    @property
    def digest(self) -> str:
        """SHA-256 of what the file holds."""
        return hashlib.sha256(self._text.encode()).hexdigest()

    @cached_property
    def _text(self) -> str:
        return json.dumps(self.to_values(), indent=1) + "\n"

    def newtons(self, raw: np.ndarray) -> np.ndarray:
        """Newtons (n, c) float64 of counts (n, c)."""
        zero = np.array([one.zero for one in self.channels])
        return (raw - zero) / np.array([one.counts_per_newton for one in self.channels])

    def index(self, name: str) -> int:
        """The column of the channel of that name. Raises TrialError without one."""
        names = [one.channel.name for one in self.channels]
        if name not in names:
            raise TrialError(f"no channel is called {name}", where=f"device {self.device}", cure=f"It has {names}.")
        return names.index(name)

    def age_days(self, now: float) -> float:
        """Days from when it was taken to ``now``, in seconds since 1970."""
        return (now - self.taken.timestamp()) / 86400.0

    def is_of(self, hello: Hello) -> bool:
        """Whether it is of the device that says ``hello``, with the channels that it has now."""
        return hello.device == self.device and self.measures(hello.channels)

    def measures(self, channels: Sequence[Channel]) -> bool:
        """Whether it is of these channels, in their order."""
        return tuple(one.channel for one in self.channels) == tuple(channels)

    def check_device(self, hello: Hello) -> None:
        """Raises TrialError where it is of another device than the one that says ``hello``."""
        if not self.is_of(hello):
            raise TrialError(
                f"this calibration is of {self.device}, not of {hello.device} as it is now",
                cure="Give the calibration of this device and these channels, or calibrate it.",
            )


def _channel(record: Any) -> ChannelCalibration:
    lowest, highest = int(record["lowest"]), int(record["highest"])
    if not -(1 << 31) <= lowest < highest < 1 << 31:
        raise ValueError("no range")
    points = tuple(
        Point(*(_bounded(point[name]) for name in ("newtons", "counts", "spread"))) for point in record["points"]
    )
    return ChannelCalibration(Channel(_word(record["name"]), lowest, highest), points)


def _bounded(value: Any) -> float:
    number = finite_number(value)
    if abs(number) >= 1 << 31:
        raise ValueError("a number beyond every load")
    return number


def _word(value: Any) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= 24 or not value.isascii() or not value.isprintable():
        raise ValueError("no name")
    return value
