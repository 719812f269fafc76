"""A device's port: what it sends, when it came, and that it ended.

The port is read by a thread of its own, so that what waits for a disk loses nothing: a terminal's own buffer
holds 4 kB, a tenth of a second at 1 kHz. However pyserial tells that a device is gone (``SerialException``, a plain
``OSError``, ``termios.error``, a closed descriptor), it is one ``LineLost`` here.
"""

from __future__ import annotations

import contextlib
import errno
import threading
import time
from collections import deque
from typing import Any, NamedTuple

from ...core.errors import TrialError
from .adapters import Adapter, AsciiStream

MOST_HELD = 4 << 20
"""Bytes that wait to be taken; a line that sends more is given up, which the trial would not outlive anyway."""

_PIECE = 4096
_READ_S, _ANSWER_S, _JOIN_S = 0.001, 0.2, 10.0


class LineLost(TrialError):  # noqa: N818 - what happened, not whose fault
    """The device was unplugged, or its port failed otherwise; nothing more comes."""


class Received(NamedTuple):
    """Bytes as they came, and when they were read: ``received_ns`` monotonic, ``wall_ns`` since 1970."""

    data: bytes
    received_ns: int
    wall_ns: int


class Device:
    """An open port; ``open_device`` makes it. Closed by ``close`` or at the end of its ``with`` block."""

    def __init__(self, port: Any, url: str, adapter: Adapter) -> None:
        self.url, self.adapter = url, adapter
        self._port = port
        self._pieces: deque[Received] = deque()
        self._held = 0
        self._end: str | None = None
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"line {url}", daemon=True)
        self._thread.start()

    def read(self, timeout_s: float) -> Received:
        """The next bytes, at most 4,096; none when none come within ``timeout_s``.

        Raises LineLost once all that came before is taken, each time from then on.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._pieces or self._end is not None, timeout_s)
            if self._pieces:
                piece = self._pieces.popleft()
                self._held -= len(piece.data)
                return piece
            if self._end is not None:
                raise LineLost(self._end, where=self.url, cure="Plug the device in again; then the next trial begins.")
        return Received(b"", time.monotonic_ns(), time.time_ns())

    def close(self) -> None:
        """Give the port back; a second time is nothing."""
        self._closing.set()
        self._thread.join(_JOIN_S)

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        end = "the port was closed"
        try:
            self._take()
        except Exception as error:  # pyserial passes on whatever its platform raises
            end = f"the line was lost: {error or type(error).__name__}"
        finally:
            with contextlib.suppress(Exception):  # a port that is gone may not be closed either
                self._port.close()
            with self._changed:
                self._end = end
                self._changed.notify_all()

    def _take(self) -> None:
        """Read until it is closed; short sleeps between gather the samples of 10 ms in one reading."""
        request, asked_s = self.adapter.request, -_ANSWER_S
        while not self._closing.is_set():
            if request and time.monotonic() - asked_s >= _ANSWER_S:
                asked_s = time.monotonic()
                self._port.write(request)
            data = self._port.read(_PIECE)
            if data:
                piece = Received(data, time.monotonic_ns(), time.time_ns())
                if b"\n" in data:  # answered: ask again
                    asked_s = -_ANSWER_S
                with self._changed:
                    self._held += len(data)
                    if self._held > MOST_HELD:
                        raise TrialError(f"more than {MOST_HELD} bytes of it were not taken")
                    self._pieces.append(piece)
                    self._changed.notify()
            if len(data) < _PIECE:
                self._closing.wait(self.adapter.pause_s)


def open_device(url: str, adapter: Adapter | None = None, baud: int | None = None) -> Device:
    """Open a port by its name or any URL of pyserial: ``/dev/ttyACM0``, ``COM3``, ``socket://``, ``rfc2217://``...

    ``adapter`` is by default the ASCII stream, ``baud`` the adapter's; USB of the board's own and sockets have
    none. Raises TrialError where it cannot be opened, also while another program has it open.
    """
    import serial

    adapter = adapter or AsciiStream()
    # Read without waiting: what pyserial read before it met the end within one call would be lost. Ports by
    # RFC 2217 give one byte a call then, and have a time for writing of their own.
    options = {"timeout": _READ_S} if url.lower().startswith("rfc2217:") else {"timeout": 0, "write_timeout": _ANSWER_S}
    try:
        port = serial.serial_for_url(url, baudrate=baud or adapter.baud, exclusive=True, **options)
    except Exception as error:  # as in reading; a wrong URL is a ValueError or an AttributeError of pyserial's
        raise TrialError(f"the device cannot be opened: {error}", where=url, cure=_cure(error)) from error
    return Device(port, url, adapter)


def _cure(error: Exception) -> str:
    if getattr(error, "errno", None) == errno.EACCES:
        return "On Linux, become a member of the group that owns the port, as `sudo usermod -aG dialout $USER` does."
    return "See that it is plugged in and that no other program has it open; `python -m serial.tools.list_ports` lists."
