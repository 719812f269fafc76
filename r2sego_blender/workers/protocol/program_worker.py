"""Workers that are programs: started by a command, asked by lines on their standard input."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ..library_path import IMPORT_LIBRARY, LIBRARY
from .asking import Tell
from .response import Limits
from .running import RunningProgram
from .serving import RESPONSE_FILE


class ProgramWorker:
    """A program that serves tasks by ``serving``, started with the first request and again after it has ended."""

    def __init__(self, command: Sequence[str], name: str, cure: str) -> None:
        """``name`` is where errors are, ``cure`` what they advise when it breaks."""
        self.name, self.cure = name, cure
        self._command = list(command)
        self._program: RunningProgram | None = None

    def __enter__(self) -> ProgramWorker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def answer(self, request: Path, response: Path, tell: Tell, limits: Limits) -> None:
        """See ``asking.Worker``."""
        if self._program is None or not self._program.runs:
            self.close()
            self._program = RunningProgram(self._command, self.name, self.cure)
        self._program.ask(json.dumps({"request": str(request), "response": str(response)}))
        status = self._program.wait((response / RESPONSE_FILE).is_file, response, tell, limits)
        if status is not None and (status or not (response / RESPONSE_FILE).is_file()):
            raise self._program.ended(status)

    def close(self) -> None:
        """See ``asking.Worker``."""
        if self._program is not None:
            self._program.end()
            self._program = None


def library_command(python: str, module: str, *arguments: str) -> list[str]:
    """The command by which ``python`` runs ``main`` of a module of this library, such as ``workers.models.sam3``.

    It finds the library by its place and nothing else of this environment.
    """
    run = f"from {LIBRARY.name}.{module} import main\nmain(*sys.argv[1:])\n"
    return [python, "-c", f"{IMPORT_LIBRARY}\n{run}", *arguments]
