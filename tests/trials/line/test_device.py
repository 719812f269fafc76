"""Ports of every kind of URL are read alike, and however one ends it is one loss of the line, once all is taken."""

import contextlib
import os
import random
import sys
import threading
import time

import pytest
import serial
import serial.rfc2217
from socket_servers import served

from r2sego_blender.core.errors import TrialError
from r2sego_blender.trials.line.adapters import AsciiStream, Mark10
from r2sego_blender.trials.line.decoding import Decoder, Sample
from r2sego_blender.trials.line.device import MOST_HELD, Device, LineLost, open_device
from r2sego_blender.trials.line.framing import sample_line

if sys.platform == "win32":
    pytest.skip("the tests' devices are terminals", allow_module_level=True)

import pty
import termios
import tty

LINES = [sample_line(n, 1000 * n, [n, -n], 0) for n in range(200)]


class Port:
    """A port that gives pieces, then fails or stays silent."""

    def __init__(self, pieces, error=None):
        self.pieces, self.error, self.is_closed = list(pieces), error, False

    def read(self, size):
        if self.is_closed:
            raise TypeError("an integer is required")
        if self.pieces:
            return self.pieces.pop(0)
        if self.error is not None:
            raise self.error
        return b""

    def close(self):
        self.is_closed = True


def all_of(device, timeout_s=2.0):
    """What a device sends until it is lost or silent."""
    data = b""
    with contextlib.suppress(LineLost):
        while piece := device.read(timeout_s).data:
            data += piece
    return data


@pytest.mark.parametrize(
    "error",
    [
        serial.SerialException("device reports readiness to read but returned no data"),
        OSError(5, "Input/output error"),
        termios.error(5, "Input/output error"),
        TypeError("argument must be an int, or have a fileno() method"),
        ValueError("file descriptor cannot be a negative integer (-1)"),
        serial.PortNotOpenError(),
        MemoryError(),
        RuntimeError(),
    ],
    ids=lambda error: type(error).__name__,
)
def test_whatever_a_port_raises_is_a_lost_line_after_all_that_came_before(error):
    port = Port(LINES[:9], error)
    with Device(port, "port", AsciiStream()) as device:
        assert [device.read(30.0).data for _ in range(9)] == LINES[:9]
        for _ in range(3):  # each time from then on
            with pytest.raises(LineLost, match="port"):
                device.read(30.0)
        assert port.is_closed
        assert not device._thread.is_alive()


def test_a_port_that_nobody_takes_from_is_given_up_and_its_memory_is_bounded():
    class Torrent(Port):
        def read(self, size):
            return b"x" * size

    with Device(Torrent([]), "torrent", AsciiStream()) as device:
        device._thread.join(60.0)
        data = all_of(device)
    assert len(data) <= MOST_HELD
    with pytest.raises(LineLost):
        device.read(0.0)


def test_closing_wakes_who_waits_and_a_second_time_is_nothing():
    device = Device(Port([]), "silent", AsciiStream())
    assert device.read(0.02).data == b""
    woken = []

    def wait():
        with pytest.raises(LineLost):
            device.read(30.0)
        woken.append(True)

    waiting = threading.Thread(target=wait)
    waiting.start()
    device.close()
    device.close()
    waiting.join(5.0)
    assert woken


def test_times_of_both_clocks_are_those_of_the_reading():
    before = time.monotonic_ns(), time.time_ns()
    with Device(Port([b"x"]), "port", AsciiStream()) as device:
        piece = device.read(30.0)
    assert before[0] <= piece.received_ns <= time.monotonic_ns() and before[1] <= piece.wall_ns <= time.time_ns()


def test_what_goes_round_a_loop_is_read():
    with open_device("loop://") as device:
        device._port.write(b"".join(LINES[:50]))
        assert device.read(30.0).data


@pytest.fixture
def terminal():
    """A terminal with nothing behind it: the descriptor to write to, and its name."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    open_ones = [ours, theirs]
    yield ours, os.ttyname(theirs), open_ones
    for one in open_ones:
        os.close(one)


def test_a_terminal_is_read_whole_and_lost_when_it_is_closed(terminal):
    ours, name, open_ones = terminal
    with open_device(name) as device:
        decoder, found = Decoder(), []
        for line in LINES:
            os.write(ours, line)
        while len(found) < len(LINES):
            piece = device.read(30.0)
            assert piece.data
            found += decoder.feed(piece.data, piece.received_ns)
        assert [one.sequence for one in found] == [*range(200)]
        while open_ones:
            os.close(open_ones.pop())
        with pytest.raises(LineLost):
            device.read(30.0)


@pytest.mark.parametrize("baud", [300, 115_200, 4_000_000, 12_345])
def test_noise_at_any_baud_comes_whole_and_holds_no_sample(terminal, baud):
    ours, name, _ = terminal
    noise = random.Random(baud).randbytes(250_000)

    def send():
        for at in range(0, len(noise), 1000):
            os.write(ours, noise[at : at + 1000])

    with open_device(name, baud=baud) as device:
        sender = threading.Thread(target=send)
        sender.start()
        decoder, data = Decoder(), b""
        while len(data) < len(noise):
            piece = device.read(30.0)
            assert piece.data
            data += piece.data
            assert not any(isinstance(one, Sample) for one in decoder.feed(piece.data, piece.received_ns))
        sender.join()
    assert data == noise


def test_a_port_is_one_programs_alone(terminal):
    _, name, _ = terminal
    with open_device(name), pytest.raises(TrialError, match="opened"):
        open_device(name)
    open_device(name).close()


@pytest.mark.parametrize(
    "url",
    ["/dev/r2sego-is-not-there", "socket://127.0.0.1:1", "socket://", "nonsense://x", "rfc2217://127.0.0.1:1", ""],
)
def test_what_cannot_be_opened_is_told_with_its_name(url):
    with pytest.raises(TrialError) as told:
        open_device(url)
    assert told.value.where == url and told.value.cure


def test_a_socket_is_read_whole_and_lost_when_the_other_side_goes():
    opened = threading.Event()  # opening throws away what came before

    def serve(connection):
        opened.wait(60.0)
        connection.sendall(b"".join(LINES))

    with served(serve) as port, open_device(f"socket://127.0.0.1:{port}") as device:
        opened.set()
        assert all_of(device, 10.0) == b"".join(LINES)
        with pytest.raises(LineLost):
            device.read(30.0)


def test_a_remote_port_by_rfc_2217_is_read_whole_and_lost_when_the_server_goes():
    opened, taken = threading.Event(), threading.Event()

    def serve(connection):
        remote, lock = serial.serial_for_url("loop://", timeout=0), threading.Lock()

        class Writer:
            def write(self, data):
                with lock:
                    connection.sendall(data)

        manager = serial.rfc2217.PortManager(remote, Writer())
        connection.settimeout(0.05)
        while not opened.is_set():
            with contextlib.suppress(TimeoutError):
                b"".join(manager.filter(connection.recv(1024)))
        connection.sendall(b"".join(manager.escape(b"".join(LINES))))
        taken.wait(60.0)

    with served(serve) as port, open_device(f"rfc2217://127.0.0.1:{port}") as device:
        opened.set()
        data = b""
        while len(data) < len(b"".join(LINES)):
            piece = device.read(30.0)
            assert piece.data
            data += piece.data
        assert data == b"".join(LINES)
        taken.set()
        with pytest.raises(LineLost):
            device.read(30.0)


def test_a_gauge_is_asked_for_each_reading_and_again_where_it_did_not_answer(terminal):
    ours, name, open_ones = terminal
    asked, stop = [], threading.Event()

    def answer():
        with contextlib.suppress(OSError):
            while not stop.is_set():
                if b"?" in os.read(ours, 100):
                    asked.append(time.monotonic())
                    if len(asked) != 5:
                        os.write(ours, b"-%d.5 N\r\n" % len(asked))

    gauge = threading.Thread(target=answer, daemon=True)
    gauge.start()
    with open_device(name, Mark10("seat")) as device:
        decoder, found = Mark10("seat").decoder(), []
        while len([one for one in found if isinstance(one, Sample)]) < 20:
            piece = device.read(30.0)
            assert piece.data, "it is not asked"
            found += decoder.feed(piece.data, piece.received_ns)
    stop.set()
    os.write(open_ones[1], b"?")
    gauge.join(5.0)
    counts = [one.raw[0] for one in found if isinstance(one, Sample)]
    assert counts == [-1000 * n - 500 for n in range(1, 22) if n != 5][: len(counts)]
    assert 0.2 <= asked[5] - asked[4] < 10.0
