"""The line to a device through a session: it is opened again after it was lost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from ...core.errors import TrialError
from ..line.adapters import Adapter, Decodes
from ..line.decoding import Message
from ..line.device import LineLost, Received
from ..line.framing import LONGEST_LINE
from ..stream import Hello
from .clock import Clock

_AGAIN_S = 0.5  # between two tries to open a line
_MOST_PIECES = 1000  # at once, 4 kB each


class Line(Protocol):
    """An open line; ``line.device.Device`` is one."""

    @property
    def url(self) -> str: ...
    @property
    def adapter(self) -> Adapter: ...
    def read(self, timeout_s: float) -> Received:
        """The next bytes, at the latest after this long; empty for none. Raises LineLost."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


@dataclass(frozen=True)
class Heard:
    """What a moment brought: bytes and their ``messages``, and then why the line was ``lost`` in it, "" if not."""

    received: list[Received] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)
    lost: str = ""


class Connection:
    """The line that ``open_line`` opens, again and again until it can.

    ``hello`` is the device's last one, None before it; ``rest`` what came of a line that has not ended yet, which a
    record has to begin with; ``problem`` is why there is no line.
    """

    def __init__(self, open_line: Callable[[], Line], clock: Clock) -> None:
        self._open_line, self._clock = open_line, clock
        self._decoder: Decodes | None = None
        self._next_ns = 0
        self.line: Line | None = None
        self.hello: Hello | None = None
        self.rest = Received(b"", 0, 0)
        self.problem = ""

    def hear(self, seconds: float) -> Heard:
        """What comes within so long. A line that is lost is told, not raised; the next call opens it again."""
        self._clock.sleep(seconds)  # what came meanwhile is gathered: a wake-up a sample costs more than reading it
        heard = Heard()
        if self.line is None and not self._open():
            return heard
        assert self.line is not None and self._decoder is not None
        try:
            while len(heard.received) < _MOST_PIECES and (received := self.line.read(0.0)).data:
                heard.received.append(received)
                self._keep_rest(received)
                heard.messages.extend(self._decoder.feed(received.data, received.received_ns))
        except LineLost as error:
            self.close()
            self.problem = str(error)
            heard = Heard(heard.received, heard.messages, self.problem)
        for message in heard.messages:
            if isinstance(message, Hello) and self.line is not None:
                self.hello = message
        return heard

    def close(self) -> None:
        """Let go of the line."""
        if self.line is not None:
            self.line.close()
        self.line = self._decoder = self.hello = None
        self.rest = Received(b"", 0, 0)

    def _keep_rest(self, received: Received) -> None:
        _, newline, rest = received.data.rpartition(b"\n")
        before = b"" if newline else self.rest.data
        self.rest = received._replace(data=(before + rest)[: LONGEST_LINE + 1])

    def _open(self) -> bool:
        now_ns = self._clock.monotonic_ns()
        if now_ns < self._next_ns:
            return False
        self._next_ns = now_ns + round(_AGAIN_S * 1e9)
        try:
            self.line = self._open_line()
        except TrialError as error:
            self.problem = str(error)
            return False
        self._decoder, self.problem = self.line.adapter.decoder(), ""
        return True
