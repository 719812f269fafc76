"""Changes of XML: attributes, elements and what a parser is made to do more of."""

from __future__ import annotations

import re
from random import Random

from .text import NUMBERS, OUTSIDE, WORDS, changed_by, changed_text, times

_ATTRIBUTE = re.compile(rb'\b([\w:]{1,40})="([^"]*)"')
_ELEMENT = re.compile(rb"<\w[^<>]*/>")
_LAUGHS = b'<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa">' + b"".join(
    b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9)
)
_ELEMENTS = (
    *('<include file="../../outside/secret.xml"/>', f'<include file="{OUTSIDE}.xml"/>', '<include file="robot.xml"/>'),
    *('<replicate count="100000000"><geom size="1"/></replicate>', "<composite/>", '<geom type="mesh" mesh="m"/>'),
    *('<mesh name="m" file="../../outside/secret.stl"/>', '<body name="b"/>', '<plugin plugin="x"/>', "<a>" * 3000),
    *(
        '<hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/>',
        '<joint type="ball"/>',
        "<frame/>",
        "<keyframe/>",
    ),
    *('<geom size="0.1" mass="1e300"/>', '<site pos="nan 0 0"/>', '<texture type="2d" file="x.png"/>', "<worldbody/>"),
)


def changed_xml(data: bytes, rng: Random) -> tuple[bytes, str]:
    """An XML file with a few changes to it, and their names."""
    return changed_by(_CHANGES, data, rng)


def _attribute(data: bytes, rng: Random) -> tuple[bytes, str]:
    found = list(_ATTRIBUTE.finditer(data))
    if not found:
        return changed_text(data, rng)
    one = rng.choice(found)
    words = one[2].split() or [b""]
    match rng.randrange(5):
        case 0:
            return data[: one.start()] + data[one.end() :], f"{one[1].decode()} gone"
        case 1:
            words[rng.randrange(len(words))] = rng.choice(WORDS).encode()
        case 2:
            words = rng.choice((words[:-1], words * 2, words * times(3000, len(one[2])), [rng.choice(found)[2]]))
        case _:
            words[rng.randrange(len(words))] = rng.choice(NUMBERS).encode()
    value = b" ".join(words).replace(b'"', b"&quot;")
    return data[: one.start(2)] + value + data[one.end(2) :], f"{one[1].decode()}={value[:24].decode('latin-1')!r}"


def _element(data: bytes, rng: Random) -> tuple[bytes, str]:
    found = list(_ELEMENT.finditer(data))
    if not found:
        return changed_text(data, rng)
    one, other = rng.choice(found), rng.choice(found)
    match rng.randrange(4):
        case 0:
            return data[: one.start()] + data[one.end() :], "an element gone"
        case 1:
            doubled = other[0] * times(rng.choice((1, 1, 300)), len(other[0]))
            return data[: one.end()] + doubled + data[one.end() :], "an element doubled"
        case 2:
            return data[: one.start()] + other[0] + data[one.end() :], "another element"
        case _:
            new = rng.choice(_ELEMENTS)
            return data[: one.end()] + new.encode() + data[one.end() :], f"with {new[:30]}"


def _entities(data: bytes, rng: Random) -> tuple[bytes, str]:
    if rng.random() < 0.5:
        return b'<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + data.replace(b'="', b'="&a;', 1), "an entity"
    return _LAUGHS + b"]>" + data.replace(b'="', b'="&j;', 1), "laughs"


def _text(data: bytes, rng: Random) -> tuple[bytes, str]:
    return changed_text(data, rng)


_CHANGES = (_attribute,) * 8 + (_element,) * 4 + (_text,) * 3 + (_entities,)
