"""What a device at a trial sends: its greeting, and samples of raw counts."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import numpy as np


class Flags(IntFlag):
    """What a device says of a sample beside its counts."""

    EMERGENCY_STOP = 1
    """Its emergency circuit is open: the button was pressed."""

    SATURATED = 2
    """A channel stands at an end of its range."""

    SENSOR_FAULT = 4
    """A channel could not be read; its count is the one before."""


@dataclass(frozen=True)
class Channel:
    """One load cell: ``name`` ("tether", "seat", ...) and the counts between which it measures."""

    name: str
    lowest: int
    highest: int


def kind_of(channel: str) -> str:
    """What a channel of that name bears, "tether" or "seat": the name up to an underscore, as of "seat_left"."""
    return channel.partition("_")[0]


@dataclass(frozen=True)
class Hello:
    """What a device says of itself once a second.

    ``boot`` differs after each start of the device, ``rate_hz`` is what it means to send.
    """

    version: int
    device: str
    firmware: str
    boot: int
    rate_hz: float
    channels: tuple[Channel, ...]


@dataclass(frozen=True)
class Stream:
    """The samples of one recording, in the order in which they came.

    ``sequence`` (n,) int64 and ``device_us`` (n,) int64 count on where the device's counters wrap;
    ``received_ns`` (n,) int64 is the host's monotonic clock when a sample was read; ``raw`` (n, c) int64 are
    counts of ``channels``, ``flags`` (n,) uint8 those of ``Flags``. ``resets_ns`` (k,) int64 are when the device
    began anew, from when on its counters count on from their last values; ``damaged_ns`` (d,) int64 when lines
    came that were no samples; ``lost_ns`` (l,) int64 when the line itself was lost (unplugged).
    """

    channels: tuple[Channel, ...]
    rate_hz: float
    sequence: np.ndarray
    device_us: np.ndarray
    received_ns: np.ndarray
    raw: np.ndarray
    flags: np.ndarray
    resets_ns: np.ndarray
    damaged_ns: np.ndarray
    lost_ns: np.ndarray
