"""Text of others, as a terminal, a report or a panel may show it."""

from __future__ import annotations

import re

_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")
"""Controls, with which a name moves a terminal's cursor or recolours it; marks that turn a line around;
halves of characters, which cannot be written at all."""

_LONGEST = 600


def printable(text: str, longest: int = _LONGEST) -> str:
    """``text`` in at most so many characters, with what controls a terminal written out, as ``\\x1b``."""
    if len(text) > longest:
        kept = (longest - 5) // 2
        text = f"{text[:kept]} ... {text[-kept:]}"
    return _UNPRINTABLE.sub(_written_out, text)


def _written_out(found: re.Match[str]) -> str:
    code = ord(found.group())
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
