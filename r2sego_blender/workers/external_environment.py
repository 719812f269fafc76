"""Learned models in environments of their own: each needs another Python, another torch and a licence of its own.

So it runs in the interpreter that an environment variable names.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..core.errors import MachineError


def named_python(variable: str, backend: str, where: str, cure: str) -> str:
    """The interpreter that the environment ``variable`` names. Raises MachineError without one."""
    python = os.environ.get(variable, "")
    if not python:
        raise MachineError(f"{backend} is not set up on this machine", where=where, cure=cure)
    if not Path(python).is_file():
        raise MachineError(f"{variable} names no file", where=python, cure=cure)
    return python
