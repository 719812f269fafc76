"""Headless doors: ``blender --command r2sego …`` is the same command tree as ``r2sego …`` in a shell."""

import sys

import bpy

from ..r2sego_blender.bridge.shared.engine_python import interpreter
from ..r2sego_blender.core.errors import R2SEgoError
from ..r2sego_blender.workers.engine import run_in_terminal

_registered = []


def run(arguments: list[str]) -> int:
    """Run the engine with these arguments on this terminal; returns its exit status."""
    try:
        return run_in_terminal(arguments, interpreter())
    except R2SEgoError as error:
        print(f"r2sego: {error}", file=sys.stderr)
        return 1


def register() -> None:
    """Add the command."""
    _registered.append(bpy.utils.register_cli_command("r2sego", run))


def unregister() -> None:
    """Take it away again."""
    while _registered:
        bpy.utils.unregister_cli_command(_registered.pop())
