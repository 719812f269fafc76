"""A generator of a person's own: the program that ``R2SEGO_GENERATOR`` names (docs/backends.md)."""

from __future__ import annotations

import os
import re
import shlex
from contextlib import AbstractContextManager
from pathlib import Path

from ...config.settings import GenerationSettings
from ...core.digests import file_identity
from ...core.errors import MachineError
from ...workers.generator_program import GeneratorProgram
from ...workers.programs import named_command
from .program import program_generator
from .slot import ClipInputs, Generator, Installation

BACKENDS = {"command": "the program in R2SEGO_GENERATOR"}
ORDER = 2

COMMAND_VARIABLE = "R2SEGO_GENERATOR"
"""Names the program and its arguments: this machine's affair, which no bundle from elsewhere decides."""
SIZE_VARIABLE = "R2SEGO_GENERATOR_SIZE"
"""The size of the program's frames, such as "1024x576"; without it, the captures' own."""

_CURE = f"Set {COMMAND_VARIABLE} to the program that generates clips, or use --set generation.generator=blending."
_INTERPRETERS = re.compile(r"(python|pypy|bash|dash|sh|zsh|env|conda|mamba|uv|node|perl)[\d.]*w?(\.exe)?")


def installation(name: str, settings: GenerationSettings) -> Installation:
    """The program with its arguments and the size of its frames, as the environment names them.

    It is known by its words and by the content of the files among them, but for the interpreter that it is
    run by: a security update of that makes no view anew. Raises MachineError where they name none.
    """
    command, size = named_command(COMMAND_VARIABLE, "generator", "generation.generator", _CURE), _named_size()
    words = [word if _is_interpreter(word, place) else _known(word) for place, word in enumerate(command)]
    identity = {"command": words, "size": list(size) if size else None}
    return Installation(identity, tuple(command), size)


def make(installed: Installation, inputs: ClipInputs) -> AbstractContextManager[Generator]:
    """The program, asked through files."""
    cure = f"Mend the program in {COMMAND_VARIABLE}, see docs/backends.md."
    worker = GeneratorProgram(installed.command, shlex.join(installed.command), cure)
    return program_generator(worker, installed, inputs)


def _is_interpreter(word: str, place: int) -> bool:
    return place == 0 and _INTERPRETERS.fullmatch(Path(word).name) is not None


def _known(word: str) -> str | list[str]:
    """A word, or the name and the identity of the file that it names."""
    try:
        return [Path(word).name, file_identity(Path(word))] if Path(word).is_file() else word
    except (OSError, ValueError):  # it may not be read, is too long for a name, or has a zero
        return word


def _named_size() -> tuple[int, int] | None:
    """(width, height) of the program's frames in pixels, None where they are the captures' own.

    Raises MachineError when the environment names no size.
    """
    named = os.environ.get(SIZE_VARIABLE, "").strip()
    if not named:
        return None
    width, _, height = named.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) >= 1 and int(height) >= 1):
        raise MachineError(f"{SIZE_VARIABLE} is no size", where=named, cure="Give width and height, such as 1024x576.")
    return int(width), int(height)
