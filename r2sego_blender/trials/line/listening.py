"""Listening to a device that is opened for it: its hello, and what it sends for some time or as long as wanted."""

from __future__ import annotations

import time
from collections.abc import Iterator

from ...core.errors import TrialError
from ..stream import Hello, Stream
from .adapters import Adapter
from .decoding import Damaged, Message, Sample, StreamBuilder
from .device import open_device

GREETING_S = 6.0
"""Longest wait for a hello, and longest silence: boards restart when they are opened, some for two seconds."""


def messages(url: str, adapter: Adapter, baud: int | None = None) -> Iterator[tuple[Hello, list[Message]]]:
    """Open a device and give what it sends, at least ten times a second, from its first hello on.

    Raises TrialError without a hello, or when it falls silent, and LineLost at the end of the line.
    """
    decoder, hello = adapter.decoder(), None
    damaged = samples = 0
    with open_device(url, adapter, baud) as device:
        heard_s = time.monotonic()
        late_s = heard_s + GREETING_S
        while True:
            piece = device.read(0.1)
            found = decoder.feed(piece.data, piece.received_ns)
            if hello is None:
                hello = next((one for one in found if isinstance(one, Hello)), None)
                if hello is not None:  # what a board sends while it starts is no part of it
                    found = found[found.index(hello) :]
                damaged += sum(isinstance(one, Damaged) for one in found)
                samples += sum(isinstance(one, Sample) for one in found)
                if hello is None and time.monotonic() > late_s:
                    raise _no_hello(url, damaged, samples)
            if hello is not None:
                yield hello, found
                if piece.data:
                    heard_s = time.monotonic()
                elif time.monotonic() - heard_s > GREETING_S:
                    raise TrialError("the device fell silent", where=url, cure="See to its cable and its sketch.")


def listen(url: str, adapter: Adapter, baud: int | None = None, seconds: float = 2.0) -> tuple[Hello, Stream]:
    """Open a device and take what it sends for so long after its first hello. Raises as ``messages``."""
    builder: StreamBuilder | None = None
    until_s = 0.0
    for hello, found in messages(url, adapter, baud):
        if builder is None:
            builder, until_s = StreamBuilder(hello), time.monotonic() + seconds
        builder.add(found, time.monotonic_ns())
        if time.monotonic() >= until_s:
            break
    assert builder is not None
    return builder.hello, builder.stream()


def _no_hello(url: str, damaged: int, samples: int) -> TrialError:
    what = f"the device did not say what it is within {GREETING_S:g} s"
    if samples:
        return TrialError(f"{what}, though it sends samples", where=url, cure="Have it send a hello once a second.")
    if damaged:
        return TrialError(f"{what}; {damaged} lines were none", where=url, cure="See that --baud is the sketch's.")
    return TrialError(f"{what}", where=url, cure="See that the sketch runs, and that this is its port.")
