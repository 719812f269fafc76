"""What an operator sees of the line is what came over it in the last second."""

import math

import pytest

from r2sego_blender.trials.line.decoding import Sample
from r2sego_blender.trials.line.simulated import simulated_calibration
from r2sego_blender.trials.running.monitor import Monitor
from r2sego_blender.trials.stream import Flags, Hello

CALIBRATION = simulated_calibration()
HELLO = Hello(1, "simulated", "1.0", 1, 100.0, tuple(one.channel for one in CALIBRATION.channels))


def fed(monitor, seconds, seat_n=0.0, first=65_500, lost=(), flags=0, begin_s=0.0):
    """100 Hz in batches of four, sequence wrapping; the samples in ``lost`` are missing."""
    counts = [
        round(cell.zero + cell.counts_per_newton * load)
        for cell, load in zip(CALIBRATION.channels, (3.0, seat_n), strict=True)
    ]
    samples = [
        Sample((first + n) % 65_536, n * 10_000, tuple(counts), flags, round((begin_s + n / 100) * 1e9))
        for n in range(round(seconds * 100))
        if n not in lost
    ]
    for begin in range(0, len(samples), 4):
        monitor.add(samples[begin : begin + 4], HELLO)


def test_rate_and_loss_are_of_the_last_second():
    monitor = Monitor(CALIBRATION, 100.0)
    fed(monitor, 3.0, lost=range(240, 250))
    rate, lost = monitor.rate(3_000_000_000)
    assert rate == pytest.approx(90, abs=5) and lost == pytest.approx(0.1, abs=0.01)
    assert monitor.rate(9_000_000_000) == (0.0, 0.0)


def test_loads_and_support_are_seen():
    monitor = Monitor(CALIBRATION, 100.0)
    fed(monitor, 1.0)
    assert monitor.supported_s(1_000_000_000) == 0.0
    fed(monitor, 1.0, seat_n=250.0, begin_s=1.0)
    assert dict(monitor.newtons) == pytest.approx({"tether": 3.0, "seat": 250.0}, abs=0.01)
    assert monitor.supported_s(2_500_000_000) == pytest.approx(1.5)
    fed(monitor, 1.0, begin_s=2.0, flags=Flags.EMERGENCY_STOP)
    assert monitor.supported_s(3_000_000_000) == 0.0 and monitor.emergency_stop
    monitor.reset()
    assert monitor.newtons == () and not monitor.emergency_stop


def test_without_a_calibration_no_load_is_known():
    monitor = Monitor(None, 100.0)
    fed(monitor, 0.1, seat_n=250.0)
    assert [math.isnan(load) for _, load in monitor.newtons] == [True, True]
