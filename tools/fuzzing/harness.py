"""What is to be known of a format to try its reader: a small right input, its reader, and its changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from .mutations.archives import changed_archive
from .mutations.arrays import changed_npy, changed_npz
from .mutations.networks import changed_onnx
from .mutations.pictures import changed_png
from .mutations.raw import changed_bytes
from .mutations.tables import changed_json, changed_lines, changed_toml
from .mutations.text import changed_text, numbers_in
from .mutations.xml import changed_xml


def _with_header(data: bytes, rng: Random) -> tuple[bytes, str]:
    """Bytes behind a header of text."""
    return numbers_in(data, rng, first=1500) if rng.random() < 0.2 else changed_bytes(data, rng)


CHANGES: Mapping[str, Callable[[bytes, Random], tuple[bytes, str]]] = {
    "archive": changed_archive,
    "bytes": changed_bytes,
    "header": _with_header,
    "json": changed_json,
    "lines": changed_lines,
    "npy": changed_npy,
    "npz": changed_npz,
    "onnx": changed_onnx,
    "png": changed_png,
    "text": changed_text,
    "toml": changed_toml,
    "xml": changed_xml,
}
"""By the kind of a file, how it is changed."""


_LONGEST_BYTES = 4 << 20


@dataclass(frozen=True)
class Harness:
    """How one format is read.

    ``name`` is the format's, as ``--format`` has it. ``build`` writes a right input into an empty folder;
    several formats may share one. ``file`` is the place in it of the file that is changed, ``kind`` one of
    ``CHANGES``. ``read`` is given the folder, reads everything in the file and gives all that a program
    would go on with; what it raises is a refusal if it is an R2SEgoError. ``share`` of the inputs of others
    are tried: readers that start a process for each file take a second.
    """

    name: str
    build: Callable[[Path], object]
    file: str
    kind: str
    read: Callable[[Path], Any]
    share: float = 1.0

    @property
    def is_picture(self) -> bool:
        """Whether memory is measured by what it declares to hold."""
        return self.kind == "png" or self.name.startswith("pictures/")

    def changed(self, data: bytes, seed: int, number: int) -> tuple[bytes, str]:
        """Input ``number`` of a seed, the same whatever came before it, and what was changed."""
        content, told = CHANGES[self.kind](data, Random(f"{seed}/{self.name}/{number}"))
        return content[:_LONGEST_BYTES], told
