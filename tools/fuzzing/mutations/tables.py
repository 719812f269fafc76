"""Changes of JSON and TOML: what stands in their tables and lists."""

from __future__ import annotations

import copy
import json
import tomllib
from collections.abc import Iterator
from random import Random
from typing import Any

import tomli_w

from .text import WORDS, changed_text

_DEEP, _DIGITS, _LARGE, _HALF = "@@deep@@", "@@digits@@", "@@large@@", "@@half@@"
_LONGEST = 4 << 20  # of what is repeated, as text: a guided search changes what it has changed
_RAW = {
    _DEEP: "[" * 20_000 + "]" * 20_000,
    _DIGITS: "9" * 5000,
    _LARGE: "[" + "0," * 200_000 + "0]",
    _HALF: '"\\ud800"',
}
_VALUES: tuple[Any, ...] = (
    *(float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e38, 1e18, 1e-320, 0, -1, 0.0, 0.5, 1, 3, True, False),
    *(
        1 << 31,
        1 << 32,
        (1 << 63) - 1,
        1 << 63,
        1 << 64,
        -(1 << 63),
        10**29,
        None,
        [],
        {},
        [[]],
        [None],
        {"a": {"b": {}}},
    ),
    *([0, 0, 0], [1e308] * 4, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "1", "nan"),
    *(_DEEP, _DIGITS, _LARGE, _HALF),
)


def changed_json(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A JSON file with a few changes to it, and their names."""
    if rng.random() < 0.2:
        return changed_text(data, rng)
    table, told = _changed(json.loads(data), rng)
    text = _with_raw(json.dumps(table, ensure_ascii=rng.random() < 0.5))
    if rng.random() < 0.05 and text.startswith("{"):
        text, told = "{" + text[1:-1] + ", " + text[1:], f"{told}; keys twice"
    return text.encode("utf-8", "surrogatepass"), told


def changed_toml(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A TOML file with a few changes to it, and their names."""
    if rng.random() < 0.3:
        return changed_text(data, rng)
    if rng.random() < 0.03:
        keys = rng.choice((1_000, 20_000))
        return data + b"\n" + b".".join([b"a"] * keys) + b" = 1\n", "dotted keys"
    table, told = _changed(tomllib.loads(data.decode()), rng)
    if not isinstance(table, dict):
        table = {"a": table}
    return _with_raw(tomli_w.dumps(_without_none(table))).encode("utf-8", "surrogatepass"), told


def changed_lines(data: bytes, rng: Random) -> tuple[bytes, str]:
    """A file of a JSON object a line, with one line changed."""
    lines = [line for line in data.split(b"\n") if line]
    if rng.random() < 0.3 or not lines:
        return changed_text(data, rng)
    at = rng.randrange(len(lines))
    lines[at], told = changed_json(lines[at], rng)
    return b"\n".join([*lines, b""]), told


def _with_raw(text: str) -> str:
    for word, raw in _RAW.items():
        text = text.replace(json.dumps(word), raw, max(1, _LONGEST // len(raw)))
    return text


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_without_none(one) for one in value]
    return "" if value is None else value


def _places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield at
    if isinstance(value, dict):
        for key, one in value.items():
            yield from _places(one, (*at, key))
    elif isinstance(value, list):
        for index, one in enumerate(value[:40]):
            yield from _places(one, (*at, index))


def _changed(table: Any, rng: Random) -> tuple[Any, str]:
    root, told = [table], []
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        place = rng.choice(list(_places(root[0])))
        holder: Any = root
        key: Any = 0
        for step in place:
            holder, key = holder[key], step
        name = rng.choice(_WAYS)(holder, key, rng) if place or rng.random() < 0.1 else ""
        told.append(f"{'.'.join(map(str, place))}: {name}")
    return root[0], "; ".join(told)


def _set(holder: Any, key: Any, rng: Random) -> str:
    holder[key] = copy.deepcopy(rng.choice(_VALUES))
    return repr(holder[key])[:24]


def _word(holder: Any, key: Any, rng: Random) -> str:
    holder[key] = rng.choice(WORDS)
    return repr(holder[key][:24])


def _delete(holder: Any, key: Any, rng: Random) -> str:
    del holder[key]
    if not holder and isinstance(holder, list):
        holder.append(None)
    return "gone"


def _wrap(holder: Any, key: Any, rng: Random) -> str:
    holder[key] = [holder[key]] if rng.random() < 0.5 else {"a": holder[key]}
    return "wrapped"


def _number(holder: Any, key: Any, rng: Random) -> str:
    value = holder[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return _set(holder, key, rng)
    if not abs(value) < 1e18:  # it was changed before
        return _set(holder, key, rng)
    holder[key] = rng.choice((-value, value * 1e-9, value * 1e9, value + 1, value - 1, round(value), str(value)))
    return repr(holder[key])[:24]


def _length(holder: Any, key: Any, rng: Random) -> str:
    value = holder[key]
    if isinstance(value, list) and value:
        times = min(50, max(2, _LONGEST // len(json.dumps(value))))
        holder[key] = rng.choice((value[:-1], value + value[:1], value[::-1], value * times, []))
        return f"{len(holder[key])} long"
    if isinstance(value, dict):
        value[rng.choice(WORDS)] = rng.choice(_VALUES[:20])
        return "a key more"
    return _number(holder, key, rng)


_WAYS = (_set, _set, _set, _word, _delete, _wrap, _number, _number, _length)
