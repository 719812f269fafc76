"""Formatting of numbers for people: counts, shares, and numbers compared with a limit."""

from __future__ import annotations

import math

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
