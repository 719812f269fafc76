"""A line is heard to its end, opened again after it, and a record can begin at the start of one of its lines."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.line.adapters import AsciiStream
from r2sego_blender.trials.line.decoding import Sample
from r2sego_blender.trials.line.device import LineLost, Received
from r2sego_blender.trials.line.framing import LONGEST_LINE, hello_line, sample_line
from r2sego_blender.trials.running.clock import SimulatedClock
from r2sego_blender.trials.running.connection import Connection
from r2sego_blender.trials.stream import Hello

SENT = hello_line("cells", "1.0", 7, 100, [("tether", -8388608, 8388607), ("seat", -8388608, 8388607)]) + b"".join(
    sample_line(n, 10_000 * n, (n, -n), 0) for n in range(40)
)


class Pieces:
    """A line that gives these pieces, one each time that it is asked, and then is lost."""

    url, adapter = "pieces:", AsciiStream()

    def __init__(self, pieces, clock):
        self.pieces, self.clock, self.closed = list(pieces), clock, False

    def read(self, timeout_s):
        if not self.pieces:
            raise LineLost("it ended")
        return Received(self.pieces.pop(0), self.clock.monotonic_ns(), self.clock.wall_ns())

    def close(self):
        self.closed = True


def cut(data, places):
    edges = [0, *sorted(place % (len(data) + 1) for place in places), len(data)]
    return [data[begin:end] for begin, end in itertools.pairwise(edges)]


@given(st.lists(st.integers(0, 10_000), max_size=30))
def test_all_that_came_is_heard_and_what_follows_the_rest_are_whole_lines(places):
    clock = SimulatedClock()
    pieces = cut(SENT, places)
    heard, samples, taken, lines = [], 0, 0, Pieces(pieces, clock)
    connection = Connection(lambda: lines, clock)
    lost = ""
    while not lost:
        moment = connection.hear(0.1)
        heard += [received.data for received in moment.received]
        samples += sum(isinstance(message, Sample) for message in moment.messages)
        taken, lost = sum(map(len, heard)), moment.lost
        if not lost:
            assert connection.rest.data == SENT[:taken].rpartition(b"\n")[2]
    assert b"".join(heard) == SENT and samples == 40
    assert lines.closed and connection.hello is None and connection.rest.data == b""


def test_the_device_says_who_it_is():
    clock = SimulatedClock()
    connection = Connection(lambda: Pieces([SENT, b"", b"x" * 100_000, b""], clock), clock)
    connection.hear(0.1)
    assert isinstance(connection.hello, Hello) and connection.hello.device == "cells"
    connection.hear(0.1)
    assert len(connection.rest.data) <= LONGEST_LINE + 1


def test_a_line_that_cannot_be_opened_is_tried_again_but_not_all_the_time():
    clock, tries = SimulatedClock(), []

    def opened():
        tries.append(clock.monotonic_ns())
        if len(tries) < 4:
            raise TrialError("not there")
        return Pieces([SENT, b""], clock)

    connection = Connection(opened, clock)
    while connection.hello is None:
        connection.hear(0.04)
        assert (connection.hello is None) == bool(connection.problem)
    gaps = [(later - earlier) / 1e9 for earlier, later in itertools.pairwise(tries)]
    assert len(tries) == 4 and gaps == pytest.approx([0.5] * 3, abs=0.05)
