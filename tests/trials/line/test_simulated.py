"""Simulated devices send what a board would: the same bytes in both languages, and what each script says."""

import subprocess
import sys

import numpy as np
import pytest

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.line.decoding import Damaged, Decoder, Sample, StreamBuilder
from r2sego_blender.trials.line.device import LineLost, open_device
from r2sego_blender.trials.line.simulated import (
    SCRIPTS,
    cell_arguments,
    device_program,
    script_named,
    simulated_calibration,
    simulated_device,
)
from r2sego_blender.trials.stream import Flags, Hello

RATE = 200


def sent(script, language, seed=5, seconds=7, rate=RATE):
    command = [*device_program(language), *map(str, [rate, 1000, 1, seconds * rate, *cell_arguments()])]
    return subprocess.run(
        command, input=script_named(script).line(seed).encode(), capture_output=True, check=True
    ).stdout


def decoded(data):
    return Decoder().feed(data, 0)


def stream_of(script, **options):
    messages = decoded(sent(script, None, **options))
    assert isinstance(messages[0], Hello)
    builder = StreamBuilder(messages[0])
    builder.add(messages[1:], 0)
    return builder.stream()


@pytest.mark.parametrize("script", [*SCRIPTS, "weights:5:0", "weights:-2:1.5"])
def test_both_languages_send_the_same_bytes(script):
    try:
        compiled = sent(script, "c++")
    except TrialError:
        pytest.skip("g++ is not installed")
    assert compiled == sent(script, "python")
    assert compiled != sent(script, "python", seed=6)


def test_a_sound_device_wraps_its_counters_and_loses_nothing():
    stream = stream_of("success")
    assert len(stream.sequence) == 7 * RATE and stream.sequence[-1] > 65535 and stream.device_us[-1] > 1 << 32
    assert set(np.diff(stream.sequence)) == {1} and set(np.diff(stream.device_us)) == {1_000_000 // RATE}
    assert not len(stream.resets_ns) and not len(stream.damaged_ns) and not stream.flags.any()


def test_its_loads_are_the_scripts_by_its_calibration():
    newtons = simulated_calibration().newtons(stream_of("success").raw)
    np.testing.assert_allclose(newtons[:, 0], 3.0, atol=0.3)
    np.testing.assert_allclose(newtons[: 2 * RATE, 1], 0.0, atol=0.3)
    np.testing.assert_allclose(newtons[3 * RATE :, 1], 260.0, atol=0.3)
    weights = simulated_calibration().newtons(stream_of("weights:5:-10").raw)
    np.testing.assert_allclose(weights.mean(axis=0), [5 * 9.80665, -10 * 9.80665], atol=0.02)


def test_scripts_do_what_they_are_named_by():
    assert simulated_calibration().newtons(stream_of("tether").raw)[-1, 0] > 200
    fall = simulated_calibration().newtons(stream_of("fall").raw)
    assert fall[:, 1].max() > 200 and abs(fall[-1, 1]) < 1 and fall[-1, 0] > 300
    for script, flag in (
        ("stop", Flags.EMERGENCY_STOP),
        ("fault", Flags.SENSOR_FAULT),
        ("saturation", Flags.SATURATED),
    ):
        flags = stream_of(script).flags
        assert set(flags.tolist()) == {0, flag} and not flags[: 3 * RATE].any()
    assert stream_of("saturation").raw[:, 1].max() == (1 << 23) - 1
    for script, gap_us in (("gap", 120_000), ("silence", 500_000)):
        stream = stream_of(script)
        assert np.diff(stream.device_us).max() - gap_us in range(1, 5001) and set(np.diff(stream.sequence)) == {1}
    assert np.diff(stream_of("loss").sequence).max() == 2
    reset = stream_of("reset")
    assert len(reset.resets_ns) == 1 and set(np.diff(reset.sequence)) == {1}
    np.testing.assert_allclose(np.diff(stream_of("drift").device_us), 1.02e6 / RATE, atol=1)
    noise = decoded(sent("noise", None))
    assert 10 < sum(isinstance(one, Damaged) for one in noise) < 40
    assert np.diff(stream_of("noise").sequence).max() in (2, 3)  # what is left of a line damages the next, too
    assert len(stream_of("unplug").sequence) == 3 * RATE


def take(device, seconds, decoder=None):
    """Messages until some time of the device has passed."""
    decoder = decoder or Decoder()
    found = []
    while sum(isinstance(one, Sample) for one in found) < seconds * RATE:
        piece = device.read(30.0)
        assert piece.data, "it sends nothing"
        found += decoder.feed(piece.data, piece.received_ns)
    return found


@pytest.mark.parametrize("over", ["socket"] if sys.platform == "win32" else ["terminal", "socket"])
@pytest.mark.parametrize("language", ["c++", "python"])
def test_it_is_read_as_a_board_is_unplugged_and_plugged_in_again(over, language):
    try:
        simulated = simulated_device("success", 1, RATE, language=language, over=over)
    except TrialError:
        pytest.skip("g++ is not installed")
    with simulated as url:
        with open_device(url) as device:
            before = take(device, 1.1)
            assert not any(isinstance(one, Damaged) for one in before)
            simulated.play("stop")
            simulated.unplug()
            with pytest.raises(LineLost):
                while True:
                    device.read(30.0)
            with pytest.raises(TrialError):
                open_device(url)
        simulated.plug_in()
        with open_device(url) as device:
            after = take(device, 1.1)
        boots = [next(one.boot for one in found if isinstance(one, Hello)) for found in (before, after)]
        assert boots[0] != boots[1]
        simulated.play("unplug")
        with open_device(url) as device, pytest.raises(LineLost):
            while True:
                device.read(30.0)
        assert not simulated.is_plugged_in


def test_it_goes_on_with_another_script_without_a_restart():
    simulated = simulated_device("unloaded", 1, RATE, speed=4.0)
    with simulated as url, open_device(url) as device:
        decoder = Decoder()
        take(device, 1.0, decoder)
        simulated.play("weights:0:20")
        messages = take(device, 3.0, decoder)
    hello = next(one for one in messages if isinstance(one, Hello))
    builder = StreamBuilder(hello)
    builder.add(messages, 0)
    stream = builder.stream()
    assert len(stream.resets_ns) == 0 and set(np.diff(stream.sequence)) == {1}
    assert simulated_calibration().newtons(stream.raw)[-1, 1] == pytest.approx(20 * 9.80665, abs=0.5)
    passed_s = (stream.received_ns[-1] - stream.received_ns[0]) / 1e9
    assert (stream.device_us[-1] - stream.device_us[0]) / 1e6 / passed_s == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("name", ["walk", "weights", "weights:1", "weights:a:2", "weights:inf:0", "weights:nan:0"])
def test_unknown_scripts_are_refused(name):
    with pytest.raises(TrialError):
        script_named(name)
