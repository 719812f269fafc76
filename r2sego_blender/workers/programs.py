"""Programs as a person names them."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path

from ..core.errors import MachineError


def find_program(word: str) -> str | None:
    """Where a program is that is named by its path, or by its name among those of ``PATH``; None where it is not.

    By its name it is none in the folder the person stands in, where Windows looks first: that may be a bundle.
    """
    found = shutil.which(word)
    by_path = os.path.dirname(word)  # noqa: PTH120  (for Path "./tool" is "tool")
    if found is None or by_path or Path(found).is_absolute():
        return found
    return None


def named_command(variable: str, kind: str, where: str, cure: str) -> list[str]:
    """The program that the environment ``variable`` names, with its arguments; of which ``kind``, errors say.

    Raises MachineError, with ``where`` and ``cure``, where it names none.
    """
    named = os.environ.get(variable, "").strip()
    try:
        command = [named] if os.path.isfile(named) else words_of(named)  # noqa: PTH113  (no error if it is long)
    except ValueError as error:
        raise MachineError(f"{variable} is no command: {error}", where=named, cure=cure) from error
    if not command:
        raise MachineError(f"no {kind} is named", where=where, cure=cure)
    found = find_program(command[0])
    if found is None:
        raise MachineError(f"the program in {variable} is not there or cannot be run", where=command[0], cure=cure)
    return [found, *command[1:]]


def words_of(command: str, system: str = os.name) -> list[str]:
    """The words of a command; on Windows a backslash is part of a path. Raises ValueError: an open quote."""
    if system != "nt":
        return shlex.split(command)
    return [word.strip("\"'") for word in shlex.split(command, posix=False)]
