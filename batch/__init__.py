"""Headless doors: ``blender --command r2sego …`` runs the engine's commands."""

import bpy

from .command import run

_registered = []


def register() -> None:
    """Add the command."""
    _registered.append(bpy.utils.register_cli_command("r2sego", run))


def unregister() -> None:
    """Take it away again."""
    while _registered:
        bpy.utils.unregister_cli_command(_registered.pop())
