"""Which state of a file Blender shows, so that it can tell when the file was made anew. No bpy."""

from __future__ import annotations

from pathlib import Path

MADE = "r2sego_made"
"""The property of an object, or its mesh, with the ``when_written`` of the file it shows."""


def when_written(file: Path) -> str:
    """When the file was written, '' where there is none; text, since Blender's whole numbers have 32 bits."""
    return str(file.stat().st_mtime_ns) if file.is_file() else ""
