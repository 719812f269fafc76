"""A benchmark's figures on disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from r2sego_blender.core.errors import SettingsError
from r2sego_blender.core.json_files import write_json


def write_figures(path: Path, figures: dict[str, Any]) -> None:
    """Write the figures as JSON. Raises SettingsError when the disk refuses."""
    try:
        write_json(path, figures)
    except OSError as error:
        raise SettingsError(
            f"the file cannot be written: {error.strerror or error}",
            where=path,
            cure="Check that the folder is there, can be written and has room.",
        ) from error
