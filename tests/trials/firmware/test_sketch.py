"""The board's sketch, compiled with a board of its own: what its converters measure is what is decoded."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from r2sego_blender.trials.line.decoding import Damaged, Decoder, StreamBuilder
from r2sego_blender.trials.line.simulated import FIRMWARE
from r2sego_blender.trials.stream import Channel, Flags, Hello

NEVER = 10**12


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    here, made = Path(__file__).parent / "board", tmp_path_factory.mktemp("board") / "board"
    places = [f"-I{here}", f"-I{FIRMWARE / 'r2sego_trials'}"]
    warnings = ["-Wall", "-Wextra", "-Werror"]
    subprocess.run(["g++", "-std=c++17", *warnings, *places, "-o", str(made), str(here / "board.cpp")], check=True)

    def run(seconds=5, tether_us=12_500, seat_us=12_500, seat_stops_us=NEVER, pressed_us=NEVER, seat_base=5000):
        arguments = map(str, [seconds, tether_us, seat_us, seat_stops_us, pressed_us, seat_base])
        sent = subprocess.run([made, *arguments], capture_output=True, check=True).stdout
        messages = Decoder().feed(sent, 0)
        assert isinstance(messages[0], Hello) and not any(isinstance(one, Damaged) for one in messages)
        builder = StreamBuilder(messages[0])
        builder.add(messages, 0)
        return [one for one in messages if isinstance(one, Hello)], builder.stream()

    return run


def test_it_greets_once_a_second_and_says_what_it_is(board):
    hellos, _ = board()
    full = (-(1 << 23), (1 << 23) - 1)
    assert set(hellos) == {Hello(1, "cells-1", "1.0", 0, 80.0, (Channel("tether", *full), Channel("seat", *full)))}
    assert len(hellos) == 4  # the first second it measures its rate


@pytest.mark.parametrize("tether_us, seat_us", [(12_500, 12_500), (11_000, 12_800), (13_300, 11_300)])
def test_every_conversion_is_sent_once_whatever_the_converters_clocks(board, tether_us, seat_us):
    hellos, stream = board(tether_us=tether_us, seat_us=seat_us)
    np.testing.assert_array_equal(np.diff(stream.raw[:, 0]), 1)  # through zero: counts have their signs
    assert stream.raw[0, 0] < 0
    assert set(np.diff(stream.raw[:, 1])) <= {0, 1, 2} and not stream.flags.any()
    assert set(np.diff(stream.sequence)) == {1} and len(stream.resets_ns) == 0
    np.testing.assert_allclose(np.diff(stream.device_us), tether_us, atol=1000)
    assert hellos[0].rate_hz == pytest.approx(1e6 / tether_us, abs=2.0)


def test_the_emergency_contact_is_told(board):
    _, stream = board(pressed_us=3_000_000)
    began = np.flatnonzero(stream.flags)[0]
    assert set(stream.flags[began:]) == {Flags.EMERGENCY_STOP}
    assert (stream.device_us[began] - 4_292_967_296) / 1e6 == pytest.approx(3.0, abs=0.02)


def test_a_converter_that_stops_is_told_and_its_count_stays(board):
    _, stream = board(seat_stops_us=3_000_000)
    began = np.flatnonzero(stream.flags)[0]
    assert set(stream.flags[began:]) == {Flags.SENSOR_FAULT} and len(set(stream.raw[began - 1 :, 1])) == 1
    assert (stream.device_us[began] - 4_292_967_296) / 1e6 == pytest.approx(3.0, abs=0.08)


def test_a_channel_at_an_end_of_its_range_is_told(board):
    _, stream = board(seat_base=(1 << 23) - 200)
    reached = stream.raw[:, 1] == (1 << 23) - 1
    assert reached.any() and (stream.flags[reached] == Flags.SATURATED).all()
