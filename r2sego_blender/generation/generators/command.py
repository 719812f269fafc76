"""A generator of a person's own: the program that ``R2SEGO_GENERATOR`` names (docs/backends.md)."""

from __future__ import annotations

import re
import shlex
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ...config.settings import GenerationSettings
from ...core.digests import file_identity
from ...workers.generator_program import COMMAND_VARIABLE, named_command, named_size
from .program import program_generator
from .slot import ClipInputs, Generator, Installation

BACKENDS = {"command": "the program in R2SEGO_GENERATOR"}
ORDER = 2

_INTERPRETERS = re.compile(r"(python|pypy|bash|dash|sh|zsh|env|conda|mamba|uv|node|perl)[\d.]*w?(\.exe)?")


def installation(name: str, settings: GenerationSettings) -> Installation:
    """The program with its arguments and the size of its frames, as the environment names them.

    It is known by its words and by the content of the files among them, but for the interpreter that it is
    run by: a security update of that makes no view anew.
    """
    command, size = named_command(), named_size()
    words: list[Any] = list(command)
    for place, word in enumerate(command):
        file = Path(word)
        if not (place == 0 and _INTERPRETERS.fullmatch(file.name)):
            words[place] = [file.name, file_identity(file)] if _is_file(file) else word
    identity = {"command": words, "size": list(size) if size else None}
    return Installation(identity, tuple(command), size)


def make(installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
    """The program, asked through files."""
    cure = f"Mend the program in {COMMAND_VARIABLE}, see docs/backends.md."
    return program_generator(installed, inputs, shlex.join(installed.command), cure)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a word too long for a name, or with a zero
        return False
