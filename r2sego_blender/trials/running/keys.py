"""An operator's keys at a terminal: one each, and a line of text where one is told with it."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .controls import Control, Told

KEYS: Mapping[str, tuple[Control, str]] = {
    "a": (Control.ARM, "arm"),
    "s": (Control.START, "start"),
    "e": (Control.END, "end"),
    "i": (Control.INTERVENE, "intervened"),
    "x": (Control.ABORT, "abort"),
    "n": (Control.NEXT, "next"),
    "m": (Control.NOTE, "note"),
    "v": (Control.VIDEO, "video"),
    "j": (Control.JUDGE, "judge by hand"),
    "q": (Control.STOP, "stop"),
}
"""What each key does, and its word."""

_ASKED: Mapping[Control, tuple[tuple[str, str], ...]] = {
    Control.NOTE: (("text", "note"),),
    Control.VIDEO: (("text", "camera or file"),),
    Control.ABORT: (("text", "why"),),
    Control.JUDGE: (("outcome", "success, failure or unusable"), ("by", "your name"), ("text", "why")),
}
_LONGEST = 1000
_INTERRUPT = "\x03"
_SPECIAL = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|O[ -~])")
"""What a terminal sends for an arrow or a function key; F4 ends in a letter that starts a trial."""


@dataclass
class _Asking:
    control: Control
    given: dict[str, str]
    typed: str = ""

    @property
    def name(self) -> tuple[str, str]:
        return _ASKED[self.control][len(self.given)]


class Keys:
    """Makes controls of what is typed; ``prompt`` is the line that is being typed, "" for none."""

    def __init__(self) -> None:
        self._asking: _Asking | None = None

    @property
    def prompt(self) -> str:
        """What is asked for, and what was typed of it so far."""
        return "" if self._asking is None else f"{self._asking.name[1]}: {self._asking.typed}"

    def typed(self, text: str) -> list[Told]:
        """What these keys mean. Ctrl-C stops, Escape takes back what was begun; arrows and function keys do nothing."""
        return [told for key in _SPECIAL.sub("", text) if (told := self._key(key)) is not None]

    def _key(self, key: str) -> Told | None:
        if key == _INTERRUPT:
            return Told(Control.STOP, {})
        asking = self._asking
        if asking is None:
            if key.lower() not in KEYS:
                return None
            control = KEYS[key.lower()][0]
            if control not in _ASKED:
                return Told(control, {})
            self._asking = _Asking(control, {})
            return None
        if key == "\x1b":
            self._asking = None
        elif key in "\x7f\b":
            asking.typed = asking.typed[:-1]
        elif key in "\r\n":
            asking.given[asking.name[0]] = asking.typed.strip()
            asking.typed = ""
            if len(asking.given) == len(_ASKED[asking.control]):
                self._asking = None
                return Told(asking.control, asking.given)
        elif key.isprintable() and len(asking.typed) < _LONGEST:
            asking.typed += key
        return None


@contextlib.contextmanager
def terminal_keys() -> Iterator[KeyReader | None]:
    """What is typed at this process's terminal, key by key; None where standard input is none.

    Ctrl-C is a key among them, so that a trial that is stopped ends in its record.
    """
    if not sys.stdin.isatty():
        yield None
        return
    if sys.platform == "win32":
        yield KeyReader()
        return
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        own = termios.tcgetattr(sys.stdin)
        own[3] &= ~termios.ISIG
        termios.tcsetattr(sys.stdin, termios.TCSANOW, own)
        yield KeyReader()
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


class KeyReader:
    """Reads keys without waiting for them."""

    def read(self) -> str:
        """What was typed since; "" for nothing."""
        if sys.platform == "win32":
            import msvcrt

            found = ""
            while msvcrt.kbhit() and len(found) < _LONGEST:
                key = msvcrt.getwch()
                if key in "\x00\xe0" and msvcrt.kbhit():  # an arrow or a function key: a second letter names it
                    msvcrt.getwch()
                else:
                    found += key
            return found
        import select

        ready, _, _ = select.select([sys.stdin], [], [], 0)
        return os.read(sys.stdin.fileno(), _LONGEST).decode(errors="ignore") if ready else ""
