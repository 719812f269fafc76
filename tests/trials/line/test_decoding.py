"""The protocol: what is sent is what is decoded, in any pieces; what is damaged is no sample; counters wrap."""

import random
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.trials.line.decoding import Damaged, Decoder, Sample, StreamBuilder
from r2sego_blender.trials.line.framing import LONGEST_LINE, crc, hello_line, sample_line
from r2sego_blender.trials.stream import Channel, Flags, Hello

CHANNELS = (("tether", -(1 << 23), (1 << 23) - 1), ("seat", 0, 4095))
HELLO = Hello(1, "cell-1", "0.9", 7, 1000.0, tuple(Channel(*one) for one in CHANNELS))
COUNT = st.integers(-(1 << 31), (1 << 31) - 1)
RAW = st.lists(COUNT, min_size=1, max_size=8)
SAMPLE = st.tuples(st.integers(0, 65535), st.integers(0, (1 << 32) - 1), RAW, st.integers(0, 255))


def decoded(data, pieces=()):
    decoder, found, at = Decoder(), [], 0
    for size in (*pieces, len(data)):
        found += decoder.feed(data[at : at + size], 5)
        at += size
    return found


def test_the_check_is_that_of_its_name():
    assert crc(b"123456789") == 0x29B1
    assert sample_line(65535, 2**32 - 1, [84210, -21340], 0) == b"$65535,4294967295,84210,-21340,0*5B62\r\n"


@given(st.lists(SAMPLE), st.lists(st.integers(0, 60)))
def test_what_is_sent_is_what_is_decoded_in_any_pieces(samples, pieces):
    data = b"".join(sample_line(*one) for one in samples)
    expected = [Sample(sequence, us, tuple(raw), flags, 5) for sequence, us, raw, flags in samples]
    assert decoded(data, pieces) == expected


@given(st.integers(0, (1 << 32) - 1), st.integers(1, 100_000))
def test_a_hello_says_what_the_device_is(boot, rate):
    (hello,) = decoded(hello_line("cell-1", "0.9", boot, rate, CHANNELS))
    assert hello == Hello(1, "cell-1", "0.9", boot, float(rate), HELLO.channels)


@given(st.binary(max_size=3000), st.lists(st.integers(0, 700)))
def test_pieces_change_nothing_whatever_comes(data, pieces):
    assert decoded(data, pieces) == decoded(data)


@given(st.lists(st.sampled_from([b"$", b"!", b"*", b",", b"\r", b"\n", b"\r\n", b"1", b"-0", b"0", b"FFFF", b"a"])))
def test_what_only_resembles_a_line_is_none(parts):
    assert all(isinstance(one, Damaged) for one in decoded(b"".join(parts)))


@pytest.mark.parametrize(
    "body",
    [
        "1,2,3,256",
        "65536,2,3,0",
        "1,4294967296,3,0",
        "1,2,2147483648,0",
        "1,2,0",
        "01,2,3,0",
        "1,2,+3,0",
        "1,2,-0,0",
        "",
        "1.5,2,3,0",
        "-1,2,3,0",
        "1,-2,3,0",
        "1,2,3,-1",
        "1,2,3,",
        "1,2, 3,0",
        "1,2,1,2,3,4,5,6,7,8,9,0",
    ],
)
def test_numbers_outside_their_ranges_are_refused_whatever_their_check(body):
    line = b"$%s*%04X\r\n" % (body.encode(), crc(body.encode()))
    assert decoded(b"\r\n" + line) == [Damaged(5)]


@pytest.mark.parametrize(
    "body",
    [
        "2,a,b,1,10,t,0,1",
        "1,a,b,1,0,t,0,1",
        "1,a,b,1,10,t,1,1",
        "1,a,b,1,10,t,0,1,t,0,1",
        "1,a,b,1,10,4,0,1",
        "1,a,b,1,10",
        "1,,b,1,10,t,0,1",
        "1,a,b,4294967296,10,t,0,1",
        "1,a,b,1,100001,t,0,1",
        "1,a\x1b,b,1,1,t,0,1",
    ],
)
def test_hellos_that_make_no_sense_are_refused(body):
    line = b"!%s*%04X\r\n" % (body.encode(), crc(body.encode()))
    assert decoded(b"\r\n" + line) == [Damaged(5)]


def test_a_line_that_was_joined_in_its_middle_is_not_held_against_the_device():
    assert decoded(b"2,3,0*1234\r\n" + sample_line(1, 2, [3], 0)) == [Sample(1, 2, (3,), 0, 5)]
    assert decoded(sample_line(1, 2, [3], 0) + b"2,3,0*1234\r\n") == [Sample(1, 2, (3,), 0, 5), Damaged(5)]


def test_every_change_of_one_or_two_bits_or_of_two_bytes_in_a_row_is_found():
    line = bytearray(sample_line(65000, 4_000_000_000, [84210, -21340], 0))
    bits = [(at, 1 << bit) for at in range(len(line) - 2) for bit in range(8)]
    changes = [(one, other) for one in bits for other in bits if other >= one]
    random.Random(1).shuffle(changes)
    changes = [*((one, one) for one in bits), *changes[:20_000]]
    changes += [((at, x), (at + 1, y)) for at in range(len(line) - 3) for x in range(1, 256, 5) for y in (1, 77, 255)]
    for (first, mask), (second, other) in changes:
        changed = line[:]
        changed[first] ^= mask
        if (second, other) != (first, mask):
            changed[second] ^= other
        if changed != line:
            found = decoded(b"\r\n" + bytes(changed))
            assert not any(isinstance(one, Sample) for one in found), changed


def test_a_million_random_bytes_give_no_sample_and_take_no_memory():
    rng = random.Random(2)
    data = rng.randbytes(1_000_000)
    decoder, at, most = Decoder(), 0, 0
    while at < len(data):
        size = rng.choice([0, 1, 2, 7, 60, 500, 4096])
        assert all(isinstance(one, Damaged) for one in decoder.feed(data[at : at + size], 0))
        most = max(most, sum(sys.getsizeof(value) for value in vars(decoder).values()))
        at += size
    assert most <= LONGEST_LINE + 1 + 100


def test_a_million_random_bytes_of_the_protocols_own_letters_give_no_more_samples_than_the_check_lets_by():
    rng = random.Random(3)
    data = bytes(rng.choices(b"$!*,-0123456789ABCDEF\r\n", k=1_000_000))
    assert sum(isinstance(one, Sample) for one in decoded(data)) == 0


def test_of_lines_that_are_changed_anyhow_the_check_lets_one_in_65536_by():
    rng = random.Random(4)
    lines = []
    for number in range(60_000):
        line = bytearray(sample_line(number % 65536, number * 1000, [rng.randrange(90_000), 5], 0))
        star = line.index(b"*")
        for at in rng.sample([at for at in range(1, star) if line[at] != ord(",")], 5):
            line[at] = ord("1") + (line[at] - ord("1") + rng.randrange(1, 9)) % 9
        lines.append(bytes(line))
    accepted = sum(isinstance(one, Sample) for one in decoded(b"\r\n" + b"".join(lines)))
    assert accepted <= 8  # 0.9 expected; more than 8 once in a million times


def test_noise_without_an_end_is_not_kept():
    decoder = Decoder()
    for _ in range(1000):
        assert decoder.feed(b"x" * 10_000, 0) == []
    assert len(decoder._rest) == LONGEST_LINE + 1
    assert decoder.feed(b"\r\n" + sample_line(1, 2, [3], 0), 0) == [Sample(1, 2, (3,), 0, 0)]


def built(samples, hello=HELLO):
    builder = StreamBuilder(hello)
    builder.add([Sample(*one) for one in samples], 0)
    return builder.stream()


@given(st.integers(0, 65535), st.integers(0, (1 << 32) - 1), st.lists(st.integers(1, 32767), max_size=50))
def test_counters_count_on_where_they_wrap(sequence, us, steps):
    counts = np.cumsum([0, *steps])
    times = us + 1000 * counts * 40
    samples = [
        (int((sequence + n) % 65536), int(t % (1 << 32)), (1, 2), 0, i)
        for i, (n, t) in enumerate(zip(counts, times, strict=True))
    ]
    stream = built(samples)
    np.testing.assert_array_equal(stream.sequence, sequence + counts)
    np.testing.assert_array_equal(stream.device_us, times)
    assert len(stream.resets_ns) == 0 and stream.raw.shape == (len(samples), 2)


def test_a_device_that_begins_anew_is_told_once_and_counted_on():
    before = [(500 + n, 10_000 + 1000 * n, (1, 2), 0, n) for n in range(3)]
    after = [(n, 1000 * n, (1, 2), 0, 10 + n) for n in range(3)]
    stream = built(before + after)
    assert stream.resets_ns.tolist() == [10]
    assert stream.sequence.tolist() == [500, 501, 502, 503, 504, 505]
    assert stream.device_us.tolist() == [10_000, 11_000, 12_000, 12_000, 13_000, 14_000]

    builder = StreamBuilder(HELLO)
    builder.add([Sample(*one) for one in before], 2)
    builder.add([Hello(1, "cell-1", "0.9", 8, 1000.0, HELLO.channels), *(Sample(*one) for one in after)], 10)
    assert builder.stream().resets_ns.tolist() == [10]
    np.testing.assert_array_equal(builder.stream().sequence, stream.sequence)


def test_a_boot_is_seen_where_the_counters_do_not_show_it():
    builder = StreamBuilder(HELLO)
    builder.add([Sample(5, 1000, (1, 2), 0, 1)], 1)
    builder.add([HELLO, Hello(1, "cell-1", "0.9", 8, 1000.0, HELLO.channels), Sample(6, 2000, (1, 2), 0, 2)], 2)
    assert builder.stream().resets_ns.tolist() == [2]


def test_what_is_lost_or_damaged_stands_in_the_stream():
    builder = StreamBuilder(HELLO)
    builder.add([Sample(1, 2, (3,), 0, 4), Damaged(4), Sample(1, 2, (3, 4), int(Flags.SATURATED), 4)], 4)
    builder.lost(9)
    stream = builder.stream()
    assert stream.damaged_ns.tolist() == [4, 4] and stream.lost_ns.tolist() == [9]
    assert stream.raw.tolist() == [[3, 4]] and stream.flags.tolist() == [Flags.SATURATED]
