"""A gauge's readings are millinewtons, whatever its unit; what is no reading is none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.line.adapters import AsciiStream, Mark10, adapter_named
from r2sego_blender.trials.line.decoding import Damaged, Sample, StreamBuilder
from r2sego_blender.trials.line.framing import LONGEST_LINE
from r2sego_blender.trials.stream import Hello


def counts(line):
    hello, _, reading = Mark10().decoder().feed(b"0 N\n" + line, 7)
    assert isinstance(hello, Hello)
    return reading.raw[0] if isinstance(reading, Sample) else None


@pytest.mark.parametrize(
    "line, expected",
    [
        (b"-18.78 lbF\r\n", -83538),
        (b"12.5 N\r\n", 12500),
        (b"  + 0.250 kN \r\n", 250000),
        (b"-3 kgF\n", -29420),
        (b"1500 mN\r\n", 1500),
        (b"18.78\r\n", None),
        (b"18.78 lb\r\n", None),
        (b"1e3 N\r\n", None),
        (b"nan N\r\n", None),
        (b"9999999 klbF\r\n", None),
        (b"\xff18.78 N\r\n", None),
        (b"*10\r\n", None),
    ],
)
def test_readings(line, expected):
    assert counts(line) == expected


@given(st.lists(st.binary(max_size=800)))
def test_noise_is_bounded_and_its_pieces_change_nothing(pieces):
    whole, decoder = Mark10().decoder().feed(b"".join(pieces), 7), Mark10().decoder()
    parts = []
    for piece in pieces:
        parts += decoder.feed(piece, 7)
        assert len(decoder._rest) <= LONGEST_LINE + 1
    assert parts == whole


def test_readings_make_a_stream_in_which_a_damaged_one_is_missing():
    decoder = Mark10("seat").decoder()
    messages = [decoder.feed(line, 10_000_000 * n) for n, line in enumerate([b"1 N\n", b"2 N\n", b"? N\n", b"3 N\n"])]
    hello = messages[0].pop(0)
    builder = StreamBuilder(hello)
    for n, some in enumerate(messages):
        builder.add(some, 10_000_000 * n)
    stream = builder.stream()
    assert [channel.name for channel in stream.channels] == ["seat"]
    assert (stream.raw[:, 0].tolist(), stream.device_us.tolist()) == ([1000, 2000, 3000], [0, 10_000, 30_000])
    assert (stream.sequence - stream.sequence[0]).tolist() == [0, 1, 3] and len(stream.damaged_ns) == 1


@pytest.mark.parametrize("torn", [b".5 N\n", b" N\r\n", b"\n"])
def test_the_rest_of_a_reading_is_no_damaged_line(torn):
    decoder = Mark10().decoder()
    assert decoder.feed(torn, 7) == []
    assert [type(one) for one in decoder.feed(b"1 N\n" + torn, 8)] == [Hello, Sample, Damaged]


def test_a_gauge_greets_once_a_second():
    decoder = Mark10().decoder()
    found = [one for n in range(250) for one in decoder.feed(b"1 N\r\n", n * 10_000_000)]
    assert sum(isinstance(one, Hello) for one in found) == 3 and not any(isinstance(one, Damaged) for one in found)


def test_adapters_are_named_as_records_have_them():
    for adapter in (AsciiStream(), Mark10(), Mark10("seat_left")):
        assert adapter_named(adapter.name) == adapter
    assert adapter_named("mark10") == Mark10()
    for name in ("", "mark11", "mark10:", "mark10:9", "mark10:a b", "stream:x", "\x1b[2J"):
        if name != "mark10:":
            with pytest.raises(TrialError):
                adapter_named(name)
