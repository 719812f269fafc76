"""Text of others, as a terminal, a report or a panel may show it."""

from __future__ import annotations

import re

_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")
"""Controls, with which a name moves a terminal's cursor or recolours it; marks that turn a line around;
halves of characters, which cannot be written at all."""

_LONGEST = 600


def printable(text: str, longest: int = _LONGEST) -> str:
    """``text`` in at most so many characters, with what controls a terminal written out, as ``\\x1b``."""
    return _cut(_UNPRINTABLE.sub(_written_out, _cut(text, longest)), longest)


def _cut(text: str, longest: int) -> str:
    kept = (longest - 5) // 2
    return text if len(text) <= longest else f"{text[:kept]} ... {text[-kept:]}"


def _written_out(found: re.Match[str]) -> str:
    code = ord(found.group())
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
