"""The self-test passes a sound device at rest, and names what is wrong with another."""

import dataclasses

import numpy as np
import pytest

from r2sego_blender.trials.line.adapters import Mark10
from r2sego_blender.trials.line.decoding import Sample
from r2sego_blender.trials.line.self_test import SelfTest
from r2sego_blender.trials.line.simulated import simulated_calibration
from r2sego_blender.trials.stream import Hello

RATE = 80
CALIBRATION = simulated_calibration()
CHANNELS = tuple(one.channel for one in CALIBRATION.channels)
HELLO = Hello(1, CALIBRATION.device, "1.0", 1, RATE, CHANNELS)


def samples(newtons=(2.0, 0.0), noise_n=0.1, rate=RATE, flags=0, seconds=3.0):
    rng = np.random.default_rng(1)
    found = []
    for n in range(round(seconds * rate)):
        loads = np.array(newtons) + rng.normal(0.0, noise_n, 2)
        raw = [round(c.zero + c.counts_per_newton * load) for c, load in zip(CALIBRATION.channels, loads, strict=True)]
        found.append(Sample((65500 + n) % 65536, (2**32 - 9999 + round(n * 1e6 / rate)) % 2**32, tuple(raw), flags, n))
    return found


def complete(given, hello=HELLO, calibration=CALIBRATION):
    test = SelfTest(hello, calibration)
    test.add(given)
    assert test.complete
    return test


def wrong(*given, **options):
    return [what for what, _, right in complete(*given, **options).results if not right]


def test_a_sound_device_passes_once_it_was_seen_for_long_enough():
    assert complete(samples()).problems == ()
    test = SelfTest(HELLO, CALIBRATION)
    for sample in samples(seconds=2.0):  # the last comes a period before
        test.add([sample])
        assert not test.complete


@pytest.mark.parametrize(
    "given, names",
    [
        (samples(newtons=(2.0, 12.0)), ["seat"]),
        (samples(newtons=(-12.0, 0.0)), ["tether"]),
        (samples(noise_n=5.0), ["tether", "seat"]),
        (samples(rate=70), ["rate"]),
        (samples(flags=1), ["flags"]),
        (samples(flags=6), ["flags"]),
        (samples()[:50] + samples()[51:], ["missing samples"]),
        (samples()[:50] + samples()[:200], ["restarts"]),
        ([*samples()[:50], Sample(1, 2, (3,), 0, 4), *samples()[50:]], ["damaged lines"]),
        ([*samples()[:50], dataclasses.replace(HELLO, boot=2), *samples()[50:]], ["restarts"]),
    ],
)
def test_what_is_wrong_is_named(given, names):
    assert wrong(given) == names
    assert len(complete(given).problems) == len(names)


def test_a_calibration_is_of_the_device_that_is_tested():
    assert wrong(samples(), hello=dataclasses.replace(HELLO, device="other")) == ["calibration"]
    assert wrong(samples(), hello=dataclasses.replace(HELLO, device="other"), calibration=None) == []


@pytest.mark.parametrize(("rate_hz", "names"), [(24, ["rate"]), (26, []), (47, []), (110, [])])
def test_a_gauge_that_is_asked_has_no_rate_of_its_own(rate_hz, names):
    decoder = Mark10().decoder()
    sent = [one for n in range(3 * rate_hz) for one in decoder.feed(b"0.2 N\r\n", round(n * 1e9 / rate_hz))]
    hello = next(one for one in sent if isinstance(one, Hello))
    assert wrong(sent, hello=hello, calibration=None) == names


def test_a_device_whose_clock_stands_still_has_a_problem():
    test = SelfTest(HELLO, CALIBRATION)
    test.add([sample._replace(device_us=7) for sample in samples()])
    assert len(test.problems) == 1
