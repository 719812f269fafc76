"""Streams of trials as a device would send them, made in the tests; and what can spoil any of them."""

import dataclasses
from datetime import UTC, datetime, timedelta

import numpy as np

from r2sego_blender.trials.calibration.calibration import Calibration, ChannelCalibration, Point
from r2sego_blender.trials.events import EventKind, TrialEvent
from r2sego_blender.trials.stream import Channel, Flags, Stream

BEGAN_NS = 5_000_000_000
"""When trials start, by the host's clock."""

WALL_NS = 1_700_000_000 * 10**9
COUNTS_PER_N = 100
CHANNELS = (Channel("tether", -(1 << 23), (1 << 23) - 1), Channel("seat", -(1 << 23), (1 << 23) - 1))


def calibration(days=1.0, channels=CHANNELS):
    """So many counts a newton, taken so many days before the trials."""
    points = (Point(0.0, 0.0, 0.0), Point(1000.0, 1000.0 * COUNTS_PER_N, 0.0))
    taken = datetime.fromtimestamp(WALL_NS / 1e9, UTC) - timedelta(days=days)
    return Calibration("cells", "1.0", taken, tuple(ChannelCalibration(channel, points) for channel in channels))


def stream(seconds=10.0, rate_hz=200.0, loads=None, delay_us=500, seed=0):
    """A good stream that begins 50 ms before the trial; ``loads`` of times since the start give (tether, seat) in N."""
    count = round((seconds + 0.1) * rate_hz)
    since_us = np.round((np.arange(count) / rate_hz - 0.05) * 1e6).astype(np.int64)
    tether, seat = np.zeros(count), np.zeros(count)
    if loads is not None:
        tether, seat = (np.broadcast_to(load, count) for load in loads(since_us / 1e6))
    late = np.random.default_rng(seed).integers(0, delay_us + 1, count)
    received = BEGAN_NS + (since_us + late) * 1000
    none = np.zeros(0, np.int64)
    return Stream(
        CHANNELS,
        rate_hz,
        np.arange(count, dtype=np.int64) + 17,
        since_us + 1_000_000_000,
        np.maximum.accumulate(received),
        np.round(np.stack([tether, seat], axis=1) * COUNTS_PER_N).astype(np.int64),
        np.zeros(count, np.uint8),
        none,
        none,
        none,
    )


def sits(from_s, until_s=1e9, load_n=250.0, tether_n=0.0):
    """Loads of a robot that sits on the chair between two times since the start."""
    return lambda since_s: (tether_n, np.where((since_s >= from_s) & (since_s <= until_s), load_n, 0.0))


def events(seconds=10.0, *others):
    """Start and end, and others as (kind, seconds since the start)."""
    told = [(EventKind.STARTED, 0.0), *others, (EventKind.ENDED, seconds)]
    return [TrialEvent(kind, BEGAN_NS + round(s * 1e9), "", WALL_NS + round(s * 1e9)) for kind, s in told]


def kept(one, which):
    """The stream of some of its samples."""
    samples = ("sequence", "device_us", "received_ns", "raw", "flags")
    return dataclasses.replace(one, **{name: getattr(one, name)[which] for name in samples})


def with_gap(one, at, ms):
    """No sample for longer than so many milliseconds, wherever ``at`` in [0, 1] is."""
    early = int(np.searchsorted(one.device_us, one.device_us[-1] - ms * 1000))  # some come after it
    first = int(at * max(early - 1, 0))
    until = one.device_us[first] + ms * 1000
    return kept(one, ~((one.device_us > one.device_us[first]) & (one.device_us <= until)))


def with_loss(one, at, share):
    """A share of the samples lost, spread, from somewhere on."""
    count = len(one.sequence)
    lost = 1 + int(np.ceil(share * count))
    spread = np.linspace(1, count - 2, lost).astype(int)
    return kept(one, np.setdiff1d(np.arange(count), spread))


def with_saturation(one, at, channel, high):
    raw = one.raw.copy()
    raw[int(at * (len(raw) - 1)), channel] = one.channels[channel].highest if high else one.channels[channel].lowest
    return dataclasses.replace(one, raw=raw)


def with_flag(one, at, flag=Flags.SATURATED):
    flags = one.flags.copy()
    flags[int(at * (len(flags) - 1))] |= flag
    return dataclasses.replace(one, flags=flags)


def with_time(one, name, at):
    """Something that happened at a sample's time: "resets_ns" or "lost_ns"."""
    when = one.received_ns[int(at * (len(one.received_ns) - 1))]
    return dataclasses.replace(one, **{name: np.r_[getattr(one, name), when]})


def with_drift(one, share):
    """The device's clock runs faster by a share."""
    since = one.device_us - one.device_us[0]
    return dataclasses.replace(one, device_us=one.device_us[0] + np.round(since * (1.0 + share)).astype(np.int64))


def with_passing_drift(one, from_s, seconds, share):
    """The device's clock runs faster for some seconds only, and right before and after."""
    since = (one.device_us - one.device_us[0]) / 1e6
    ahead = share * np.clip(since - from_s, 0.0, seconds)
    return dataclasses.replace(one, device_us=one.device_us + np.round(ahead * 1e6).astype(np.int64))


def with_stall(one, at, ms):
    """For a while the host reads nothing, then all at once."""
    first = int(at * (len(one.received_ns) - 2))
    until = one.received_ns[first] + round(ms * 1e6)
    stalled = (np.arange(len(one.received_ns)) > first) & (one.received_ns < until)
    return dataclasses.replace(one, received_ns=np.where(stalled, until, one.received_ns))


def with_silence(one, at, ms):
    """All that is received after a moment comes later."""
    first = int(at * (len(one.received_ns) - 2))
    late = np.where(np.arange(len(one.received_ns)) > first, round(ms * 1e6), 0)
    return dataclasses.replace(one, received_ns=one.received_ns + late)
