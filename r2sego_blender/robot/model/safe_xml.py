"""XML of an unknown file, read within bounds: no document types, no entities, no deep or endless trees."""

from __future__ import annotations

import math
import re
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.parsers import expat

from ...core.errors import RobotError

_MOST_ELEMENTS = 50_000
_DEEPEST = 100
_MOST_ATTRIBUTES = 256  # MuJoCo looks for each among all those before it
_MOST_BYTES = 16 << 20
_C_NAN = re.compile(r"[+-]?nan\(\w*\)", re.IGNORECASE)


class Element(ElementTree.Element):
    """An element that knows its file and line."""

    source: Path
    line: int

    if TYPE_CHECKING:  # its children are of its own kind, as ``parse_xml`` made them

        def __iter__(self) -> Generator[Element, None, None]: ...
        def iter(self, tag: str | None = None) -> Generator[Element, None, None]: ...
        def find(self, path: str, namespaces: dict[str, str] | None = None) -> Element | None: ...

    def at(self, attribute: str = "") -> str:
        """Where it stands, in words."""
        return f"{self.source}, line {self.line}, <{' '.join(filter(None, (self.tag, attribute)))}>"


def parse_xml(text: bytes, source: Path) -> Element:
    """The tree of UTF-8 ``text``, without comments. Raises RobotError naming the line.

    Refused: a document type (it alone can declare entities), namespaces (xacro), values that
    are not finite, more than 16 MiB, 50,000 elements, 100 levels or 256 attributes of an element.
    """
    if len(text) > _MOST_BYTES:
        what = f"the file has more than {_MOST_BYTES >> 20} MiB"
        raise RobotError(what, where=source, cure="Put its meshes into files of their own.")
    return _Reader(source).read(text)


class _Reader:
    def __init__(self, source: Path) -> None:
        self._source = source
        self._open: list[Element] = []
        self._count = 0
        self._root: Element | None = None
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self, text: bytes) -> Element:
        try:
            self._parser.Parse(text, True)
        except expat.ExpatError as error:
            words = expat.errors.messages[error.code]
            raise self._refusal(f"this is no XML: {words}", "Give an MJCF or a URDF.") from error
        assert self._root is not None  # expat refuses a text without an element
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes)
        element.source, element.line = self._source, self._parser.CurrentLineNumber
        self._count += 1
        if self._count > _MOST_ELEMENTS or len(self._open) >= _DEEPEST:
            raise self._refusal(
                f"the file has more than {_MOST_ELEMENTS} elements or {_DEEPEST} levels", "Simplify it."
            )
        if len(attributes) > _MOST_ATTRIBUTES:
            raise self._refusal(
                f"<{tag}> has more than {_MOST_ATTRIBUTES} attributes", "Take those out that no robot has."
            )
        if ":" in tag:
            raise self._refusal(f"<{tag}> has a namespace", "Expand xacro first: xacro robot.xacro > robot.urdf.")
        for name, value in attributes.items():
            if name != "name" and not _is_finite(value):
                raise RobotError(
                    f"'{_short(value)}' is not finite", where=element.at(name), cure="Write finite numbers."
                )
        if self._open:
            self._open[-1].append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _doctype(self, *_: object) -> None:
        raise self._refusal("a robot file may not declare a document type", "Remove <!DOCTYPE ...>.")

    def _refusal(self, what: str, cure: str) -> RobotError:
        line = self._parser.CurrentLineNumber
        return RobotError(what, where=f"{self._source}, line {line}", cure=cure)


def _is_finite(value: str) -> bool:
    """Whether no word of ``value`` is a number that is not finite, as C or Python write it."""
    for word in value.split():
        try:
            if not math.isfinite(float(word)):
                return False
        except ValueError:
            if _C_NAN.fullmatch(word):
                return False
    return True


def _short(value: str) -> str:
    return value if len(value) <= 40 else f"{value[:37]}..."
