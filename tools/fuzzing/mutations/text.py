"""Changes of text: its numbers, words and lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from random import Random

from .raw import changed_bytes

Change = Callable[[bytes, Random], tuple[bytes, str]]
"""A change of a file's bytes: what they are then, and what it is called."""

NUMBERS = (
    *("NaN", "nan", "inf", "-inf", "Infinity", "1e308", "-1e308", "1e38", "1e309", "1e-320", "-1", "0", "0.0", "-0.0"),
    *("0.5", "1", "2147483647", "2147483648", "-2147483649", "4294967296", "9223372036854775807"),
    *("9223372036854775808", "1" + "0" * 29, "7" * 5000, "", "x", "0x10", "1_0", "+1", "1e", ".", "--1", "true"),
)
OUTSIDE = "/tmp/r2sego_outside/secret"
"""A place that no input may have read or written."""

WORDS = (
    *("", " ", "\0", "\x1b[2J\x1b[31m", "\u202e", "\ufeff", "a" * 300, "ä" * 5000, "../../outside/secret.png"),
    *("..", ".", "/", OUTSIDE, f"{OUTSIDE}.png", "C:\\secret", "\\\\host\\share", "file:///etc/passwd"),
    *("http://127.0.0.1:9/x", "CON", "a/b/c", "%s%n", "{}", "${HOME}", "\n", "\r\n", "'", '"', "]", "<!--", "\x7f\x9b"),
)
_MOST_BYTES = 1 << 22  # by repeating: what changes it again has to hold it
_NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w./-]*")


def changed_text(data: bytes, rng: Random) -> tuple[bytes, str]:
    """The text with a few changes to it, and their names."""
    return changed_by(_CHANGES, data, rng)


def changed_by(changes: Sequence[Change], data: bytes, rng: Random) -> tuple[bytes, str]:
    """The data after one to three of ``changes``, and their names."""
    told = []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data, name = rng.choice(changes)(data, rng)
        told.append(name)
    return data, "; ".join(told)


def times(count: int, size_bytes: int) -> int:
    """``count``, or as often as a piece of that size may be repeated."""
    return min(count, max(_MOST_BYTES // max(size_bytes, 1), 1))


def numbers_in(data: bytes, rng: Random, first: int = 1 << 20) -> tuple[bytes, str]:
    """Another number in the place of one of the first so many bytes'."""
    return _in_place_of(data, _NUMBER, NUMBERS, rng, first, "number")


def _in_place_of(
    data: bytes, pattern: re.Pattern[bytes], values: tuple[str, ...], rng: Random, first: int, name: str
) -> tuple[bytes, str]:
    found = list(pattern.finditer(data, 0, first))
    if not found:
        return changed_bytes(data, rng)
    one, value = rng.choice(found), rng.choice(values)
    return data[: one.start()] + value.encode() + data[one.end() :], f"{name} {value[:20]!r}"


def _numbers(data: bytes, rng: Random) -> tuple[bytes, str]:
    return numbers_in(data, rng)


def _all_numbers(data: bytes, rng: Random) -> tuple[bytes, str]:
    value, share = rng.choice(NUMBERS), rng.choice((0.1, 1.0))
    new = _NUMBER.sub(lambda one: value.encode() if rng.random() < share else one[0], data)
    return new if len(new) < 1 << 22 else data[:100], f"all numbers {value[:20]!r}"


def _words(data: bytes, rng: Random) -> tuple[bytes, str]:
    return _in_place_of(data, _WORD, WORDS, rng, 1 << 20, "word")


def _line(data: bytes, rng: Random) -> tuple[bytes, str]:
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[other])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at:at] = [lines[at]] * times(rng.choice((10, 1000)), len(lines[at]))
        case 4:
            lines[at] = lines[at].join([b" "] * 3)
        case _:
            lines = [b" ".join(lines)] if rng.random() < 0.2 else lines[: at + 1]
    return b"\n".join(lines), "line"


def _long_line(data: bytes, rng: Random) -> tuple[bytes, str]:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    piece = rng.choice((b" ", b"a", b"1 ", b"[", b"#", b'"', b"# a = ", b"=", b"1", lines[at][-20:] or b"-"))
    lines[at] += piece * (rng.choice((1_000, 100_000, 500_000)) // len(piece))
    return b"\n".join(lines), f"long line of {piece!r}"


def _bytes(data: bytes, rng: Random) -> tuple[bytes, str]:
    return changed_bytes(data, rng)


def _coded(data: bytes, rng: Random) -> tuple[bytes, str]:
    match rng.randrange(4):
        case 0:
            return b"\xef\xbb\xbf" + data, "mark of UTF-8"
        case 1:
            return data.decode("latin-1").encode("utf-16"), "UTF-16"
        case 2:
            return data.replace(b"\n", b"\r"), "carriage returns"
        case _:
            at = rng.randint(0, len(data))
            return data[:at] + rng.choice((b"\xff\xfe", b"\0" * 9, b"\x80", b"\x1b]0;")) + data[at:], "no text"


_CHANGES = (_numbers,) * 6 + (_words,) * 4 + (_line,) * 3 + (_all_numbers, _long_line, _bytes, _coded)
