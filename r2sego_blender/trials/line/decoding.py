"""Bytes of a line into messages, and messages into the ``Stream`` of a recording."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..stream import Channel, Hello, Stream
from .framing import CLOCK_US, LONGEST_LINE, MOST_CHANNELS, SEQUENCES, VERSION, crc

_NUMBER = rb"(?:0|-?[1-9]\d{0,9})"
_WORD = rb"[A-Za-z0-9_.-]{1,24}"
_SAMPLE = re.compile(rb"\$((?:%s,){3,%d}\d{1,3})\*([0-9A-F]{4})\r" % (_NUMBER, MOST_CHANNELS + 2))
_CHANNEL = rb",[A-Za-z][A-Za-z0-9_.-]{0,15},%s,%s" % (_NUMBER, _NUMBER)
_HELLO = re.compile(
    rb"!((\d{1,3}),(%s),(%s),(\d{1,10}),([1-9]\d{0,5})((?:%s){1,%d}))\*([0-9A-F]{4})\r"
    % (_WORD, _WORD, _CHANNEL, MOST_CHANNELS)
)
_LOWEST, _HIGHEST = -(1 << 31), (1 << 31) - 1


class Sample(NamedTuple):
    """One sample as it was sent: ``sequence`` and ``device_us`` wrap, ``raw`` has a count a channel."""

    sequence: int
    device_us: int
    raw: tuple[int, ...]
    flags: int
    received_ns: int


class Damaged(NamedTuple):
    """A line that was no message."""

    received_ns: int


Message = Sample | Hello | Damaged


class Decoder:
    """Messages of the protocol in ``framing``, whatever the pieces in which its bytes come.

    Each line that ends gives one message; what comes before the first line's end may be a line's rest and is
    passed over unless it is whole. Between two calls it keeps at most ``LONGEST_LINE`` + 1 bytes.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._begun = False

    def feed(self, data: bytes, received_ns: int) -> list[Message]:
        """The messages that end in ``data``, which was read at ``received_ns`` of the host's monotonic clock."""
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[: LONGEST_LINE + 1]  # a line that is longer is none, whatever follows
        damaged = Damaged(received_ns)
        found = [_message(line, received_ns) or damaged for line in lines]
        if found and not self._begun:
            self._begun = True
            if found[0] is damaged:
                del found[0]
        return found


def _message(line: bytes, received_ns: int) -> Sample | Hello | None:
    if len(line) >= LONGEST_LINE:
        return None
    if match := _SAMPLE.fullmatch(line):
        body = match[1]
        if crc(body) != int(match[2], 16):
            return None
        sequence, device_us, *raw, flags = map(int, body.split(b","))
        fits = 0 <= sequence < SEQUENCES and 0 <= device_us < CLOCK_US and flags < 256
        if not fits or min(raw) < _LOWEST or max(raw) > _HIGHEST:
            return None
        return Sample(sequence, device_us, tuple(raw), flags, received_ns)
    if match := _HELLO.fullmatch(line):
        return _hello(match)
    return None


def _hello(match: re.Match[bytes]) -> Hello | None:
    body, version, device, firmware, boot, rate, ranges, told = match.groups()
    if crc(body) != int(told, 16) or int(version) != VERSION or int(boot) >= CLOCK_US or int(rate) > 100_000:
        return None
    words = ranges.decode("ascii").split(",")[1:]
    channels = tuple(
        Channel(name, int(lowest), int(highest))
        for name, lowest, highest in zip(words[::3], words[1::3], words[2::3], strict=True)
    )
    right = all(_LOWEST <= one.lowest < one.highest <= _HIGHEST for one in channels)
    if not right or len({one.name for one in channels}) != len(channels):
        return None
    return Hello(VERSION, device.decode(), firmware.decode(), int(boot), float(rate), channels)


class StreamBuilder:
    """Makes the ``Stream`` of a recording from its messages, counting on where the device's counters wrap.

    ``hello`` is what the device said before the first of them. A sample that does not follow its forerunner
    in sequence and time, or a hello of another boot, is a reset; so, for want of better, is a pause of more
    than 32,767 samples. Samples of another number of channels count as damaged. It holds 8 (4 + channels) + 1
    bytes a sample.
    """

    def __init__(self, hello: Hello) -> None:
        self.hello = hello
        self._boot = hello.boot
        self._last: Sample | None = None
        self._sequence = self._device_us = 0
        self._anew = True
        self._columns = tuple(array("q") for _ in range(3))
        self._raw, self._flags = array("q"), array("B")
        self._resets_ns, self._damaged_ns, self._lost_ns = array("q"), array("q"), array("q")

    @property
    def lasts_us(self) -> int:
        """From the first sample to the last, by the device's clock."""
        times = self._columns[1]
        return times[-1] - times[0] if times else 0

    def add(self, messages: Iterable[Message], received_ns: int) -> None:
        """Add what a decoder gave of bytes that were read then, on the host's monotonic clock."""
        for message in messages:
            if isinstance(message, Sample) and len(message.raw) == len(self.hello.channels):
                self._count(message)
            elif not isinstance(message, Hello):
                self._damaged_ns.append(received_ns)
            elif message.boot != self._boot:
                self._boot, self._anew = message.boot, True
                self._resets_ns.append(received_ns)

    def lost(self, received_ns: int) -> None:
        """The line itself was lost then."""
        self._lost_ns.append(received_ns)

    def stream(self) -> Stream:
        """All that was added, in arrays of its own."""
        count = len(self._flags)
        sequence, device_us, received_ns = (_array(column) for column in self._columns)
        return Stream(
            self.hello.channels,
            self.hello.rate_hz,
            sequence,
            device_us,
            received_ns,
            _array(self._raw).reshape(count, len(self.hello.channels)),
            np.array(self._flags, np.uint8),
            _array(self._resets_ns),
            _array(self._damaged_ns),
            _array(self._lost_ns),
        )

    def _count(self, sample: Sample) -> None:
        if self._last is None:
            self._sequence, self._device_us = sample.sequence, sample.device_us
        else:
            steps = _forward(sample.sequence - self._last.sequence, SEQUENCES)
            passed_us = _forward(sample.device_us - self._last.device_us, CLOCK_US)
            is_reset = steps <= 0 or passed_us < 0
            if is_reset and not self._anew:  # else a hello has told it
                self._resets_ns.append(sample.received_ns)
            is_reset |= self._anew
            self._sequence += 1 if is_reset else steps
            self._device_us += 0 if is_reset else passed_us
        self._last, self._anew = sample, False
        for column, value in zip(self._columns, (self._sequence, self._device_us, sample.received_ns), strict=True):
            column.append(value)
        self._raw.extend(sample.raw)
        self._flags.append(sample.flags)


def _forward(difference: int, period: int) -> int:
    """The difference of two counts that wrap, taken the shorter way round."""
    return (difference + period // 2) % period - period // 2


def _array(values: array) -> np.ndarray:
    return np.array(values, np.int64)
