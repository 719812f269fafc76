"""The kinds of devices: what they are asked, and how their bytes become messages."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from ...core.errors import TrialError
from ..stream import Channel, Hello
from .decoding import Damaged, Decoder, Message, Sample
from .framing import CLOCK_US, LONGEST_LINE, SEQUENCES


class Decodes(Protocol):
    """What makes messages of bytes; its memory is bounded."""

    def feed(self, data: bytes, received_ns: int) -> list[Message]:
        """The messages that end in ``data``, read at ``received_ns`` of the host's monotonic clock."""


class Adapter(Protocol):
    """A kind of device.

    ``name`` is how records and commands call it (``adapter_named``), ``baud`` its usual rate, ``request`` what
    it is asked for each reading, nothing where it sends by itself, ``pause_s`` how long between two readings
    of the port.
    """

    @property
    def name(self) -> str: ...
    @property
    def baud(self) -> int: ...
    @property
    def request(self) -> bytes: ...
    @property
    def pause_s(self) -> float: ...
    def decoder(self) -> Decodes:
        """A new one, for one opening of the port."""


@dataclass(frozen=True)
class AsciiStream:
    """A device that sends the protocol in ``framing``, as the reference sketch does."""

    name: str = "stream"
    baud: int = 115_200
    request: bytes = b""
    pause_s: float = 0.01

    def decoder(self) -> Decoder:
        """A new decoder."""
        return Decoder()


_NEWTONS: Mapping[bytes, float] = {
    b"N": 1.0,
    b"mN": 0.001,
    b"kN": 1000.0,
    b"lbF": 4.4482216152605,
    b"ozF": 0.27801385095378,
    b"klbF": 4448.2216152605,
    b"gF": 0.00980665,
    b"kgF": 9.80665,
}
_READING = re.compile(rb" *([+-]? ?\d{1,7}(?:\.\d{1,6})?) *(%s) *\r?" % b"|".join(_NEWTONS))
_GAUGE_RANGE = (1 << 31) - 1

GAUGE = "mark10"
"""What a gauge is called in its hello: it answers when it is asked, and has no rate of its own."""

_HELLO_NS = 1_000_000_000


@dataclass(frozen=True)
class Mark10:
    """A force gauge of Mark-10: asked ``?``, it answers with one reading, as ``-18.78 lbF``.

    It has one ``channel``, whose counts are millinewtons. Samples are numbered and timed by this machine: a
    gauge has no clock of its own, so its drift and its restarts cannot be seen, but gaps and silence can.
    """

    channel: str = "tether"
    baud: int = 115_200
    request: bytes = b"?\r"
    pause_s: float = 0.01

    @property
    def name(self) -> str:
        """With its channel."""
        return f"mark10:{self.channel}"

    def decoder(self) -> GaugeDecoder:
        """A new decoder."""
        return GaugeDecoder(self.channel)


class GaugeDecoder:
    """Readings with units, a line each; between two calls it keeps at most ``LONGEST_LINE`` + 1 bytes."""

    def __init__(self, channel: str) -> None:
        self._hello = Hello(1, GAUGE, "unknown", 0, 50.0, (Channel(channel, -_GAUGE_RANGE, _GAUGE_RANGE),))
        self._rest = b""
        self._sequence = 0
        self._begun = False
        self._greeted_ns: int | None = None

    def feed(self, data: bytes, received_ns: int) -> list[Message]:
        """As ``Decodes.feed``: a hello before the first sample and then once a second.

        A first line that is no reading is the rest of one, and passed over.
        """
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[: LONGEST_LINE + 1]
        found: list[Message] = []
        for line in lines:
            match = _READING.fullmatch(line)
            begun, self._begun = self._begun, True
            if match is None and not begun:  # the port was opened in the middle of it
                continue
            if self._greeted_ns is None or received_ns - self._greeted_ns >= _HELLO_NS:
                self._greeted_ns = received_ns
                found.append(self._hello)
            self._sequence = (self._sequence + 1) % SEQUENCES
            counts = round(float(match[1].replace(b" ", b"")) * _NEWTONS[match[2]] * 1000) if match else None
            if counts is None or abs(counts) > _GAUGE_RANGE:
                found.append(Damaged(received_ns))
            else:
                found.append(Sample(self._sequence, received_ns // 1000 % CLOCK_US, (counts,), 0, received_ns))
        return found


def adapter_named(name: str) -> Adapter:
    """The adapter of a name: ``stream``, ``mark10`` or ``mark10:CHANNEL``. Raises TrialError for another."""
    kind, _, channel = name.partition(":")
    if name == "stream":
        return AsciiStream()
    if kind == "mark10" and re.fullmatch(r"[A-Za-z][A-Za-z0-9_.-]{0,15}", channel or "tether"):
        return Mark10(channel or "tether")
    raise TrialError(f"no kind of device is called {name[:40]}", cure="Known: stream, mark10, mark10:CHANNEL.")
