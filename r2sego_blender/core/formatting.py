"""Formatting for people: counts, shares, durations, numbers compared with a limit, and texts in tables."""

from __future__ import annotations

import math
import re

_MORE_DIGITS = 12


def told_apart(value: float, limit: float, digits: int, kind: str = "f") -> str:
    """``value`` with so many digits, and with more where it would read as if it were the ``limit`` or
    lay on its other side; ``kind`` is that of Python's formats: f counts decimals, g all digits."""
    texts = [f"{value:.{more}{kind}}" for more in range(digits, digits + _MORE_DIGITS)]
    if value == limit or not (math.isfinite(value) and math.isfinite(limit)):
        return texts[0]
    told = (text for text in texts if float(text) != limit and (float(text) > limit) == (value > limit))
    return next(told, texts[-1])


def share_apart(value: float, limit: float) -> str:
    """The same of shares in [0, 1], as per cent."""
    return f"{told_apart(100.0 * value, 100.0 * limit, 0)}%"


def share(value: float) -> str:
    """A share in [0, 1] that was set, as it was: 2.5% for 0.025."""
    return f"{100.0 * value:.6g}%"


def counted(count: int, noun: str) -> str:
    """So many of what ``noun`` names in the singular: "1 mask", "3 masks"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def duration(seconds: float) -> str:
    """A time in its two largest units: "40 s", "12 min", "1 h 20 min", "2 d 3 h"."""
    minutes = round(seconds / 60.0)
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if minutes < 60:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours < 24 else f"{hours // 24} d {hours % 24} h"


def markdown_text(text: str) -> str:
    """A text that ends no cell of a table, and is no HTML, link or picture, whoever gave the names in it."""
    return re.sub(r"[\\|<`]|\](?=[(\[:])", r"\\\g<0>", text)


_LATEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
_LATEX |= {sign: f"\\{sign}" for sign in "&%$#_{}"}


def latex_text(text: str) -> str:
    """A text as LaTeX prints it."""
    return "".join(_LATEX.get(sign, sign) for sign in text)
