r"""What stands on the wire: lines of ASCII, each with its own check.

A sample, as often as the device's rate says::

    $seq,t_us,raw...,flags*CRC\r\n          $65535,4294967295,84210,-21340,0*5B62

``seq`` counts samples, 0 to 65535, then 0 again; ``t_us`` is the device's clock in microseconds, 0 to 2^32 - 1,
then 0 again (after 71.6 minutes). ``raw`` is one whole number of 32 bits for each channel, 1 to 8 of them, in
the hello's order: counts as the converter gives them, not scaled. ``flags`` is the sum of ``stream.Flags``, 0 to 255.

A hello, at the start and once a second, says what the device is::

    !version,device,firmware,boot,rate_hz,name,lowest,highest...*CRC\r\n

``version`` is 1; ``device`` and ``firmware`` are words of 1 to 24 of ``A-Z a-z 0-9 _ . -``; ``boot``, 0 to 2^32 - 1,
differs after each start of the device; ``rate_hz`` is a whole number, 1 to 100000; then each channel's name
(a word of at most 16 letters) and the least and the greatest count that it can measure. Both begin again with a
letter where a sample has a digit, so neither is taken for the other when its first character is damaged.

``CRC`` is CRC-16/CCITT-FALSE (polynomial 0x1021 from 0xFFFF; 0x29B1 of "123456789") in four hexadecimal digits,
capital letters, over what stands between the first character and ``*``. It finds every change within 16 bits in
a row, and all but one in 65,536 of others. Numbers are decimal, without plus signs or zeros ahead. No line is longer
than ``LONGEST_LINE``. At 1 kHz with two channels that is about 40 kB/s: USB, or 460,800 baud and more.
"""

from __future__ import annotations

import binascii
from collections.abc import Iterable

LONGEST_LINE = 512
"""Bytes of a line with its end."""

VERSION = 1
MOST_CHANNELS = 8
SEQUENCES = 1 << 16
CLOCK_US = 1 << 32
"""After so many a device's counters begin again."""


def crc(body: bytes) -> int:
    """CRC-16/CCITT-FALSE of what stands between a line's first character and its ``*``."""
    return binascii.crc_hqx(body, 0xFFFF)


def sample_line(sequence: int, device_us: int, raw: Iterable[int], flags: int) -> bytes:
    """The line of a sample."""
    return _framed("$", (sequence, device_us, *raw, flags))


def hello_line(device: str, firmware: str, boot: int, rate_hz: int, channels: Iterable[tuple[str, int, int]]) -> bytes:
    """The line of a hello; ``channels`` are names with the least and the greatest count."""
    ranges = (part for channel in channels for part in channel)
    return _framed("!", (VERSION, device, firmware, boot, rate_hz, *ranges))


def _framed(start: str, parts: Iterable[object]) -> bytes:
    body = ",".join(map(str, parts)).encode("ascii")
    return b"%s%s*%04X\r\n" % (start.encode(), body, crc(body))
