"""A benchmark's figures on disk."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..errors import SettingsError


def write_figures(path: Path, figures: dict[str, Any]) -> None:
    """Write the figures as JSON. Raises SettingsError when the disk refuses."""
    try:
        path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise SettingsError(
            f"the file cannot be written: {error.strerror or error}", where=path,
            cure="Check that the folder is there, can be written and has room.",
        ) from error  # fmt: skip
