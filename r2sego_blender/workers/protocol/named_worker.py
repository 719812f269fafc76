"""A worker that a person's environment names: by its command, or by its address on this machine's loopback."""

from __future__ import annotations

import os
from pathlib import Path

from ..programs import named_command
from .asking import Worker
from .http_worker import HttpWorker
from .program_worker import ProgramWorker

TOKEN_FILE = "_TOKEN_FILE"
"""Ends the name of the variable that names the token's file of a worker on loopback."""


def named_worker(variable: str, where: str, cure: str) -> Worker:
    """The worker that the environment ``variable`` names. Raises MachineError without one, and for another host."""
    named = os.environ.get(variable, "").strip()
    if named.startswith(("http:", "https:")):
        token = os.environ.get(f"{variable}{TOKEN_FILE}", "").strip()
        return HttpWorker(named, variable, cure, Path(token) if token else None)
    return ProgramWorker(named_command(variable, "worker", where, cure), variable, cure)
