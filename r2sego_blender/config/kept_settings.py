"""Settings that a person keeps under a name: a preset and what overrides it, as small TOML files. No bpy."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.atomic_files import write_whole
from ..core.errors import SettingsError
from ..core.text_files import read_text
from .declared_files import MOST_BYTES, parse_toml
from .presets import present_keys, preset, with_overrides


def kept_settings(folder: Path) -> list[str]:
    """The names of the settings kept in a folder."""
    return sorted(file.stem for file in folder.glob("*.toml"))


def keep_settings(folder: Path, name: str, preset_name: str, overrides: Mapping[str, Any]) -> Path:
    """Write settings under a name, in place of earlier ones; the file.

    Raises SettingsError for a name that is no plain file name, or a setting that there is not.
    """
    if not re.fullmatch(r"[\w][\w .-]*", name):
        raise SettingsError(
            f"'{name}' is no name for settings", where="settings", cure="Use letters, digits and spaces."
        )
    with_overrides(overrides, preset(preset_name))
    lines = [f"preset = {json.dumps(preset_name)}", "", "[overrides]"]
    lines += [f"{json.dumps(key)} = {json.dumps(value)}" for key, value in overrides.items()]
    file = folder / f"{name}.toml"
    write_whole(file, "\n".join(lines) + "\n")
    return file


def read_settings(folder: Path, name: str) -> tuple[str, dict[str, Any]]:
    """The preset and the overrides kept under a name. Raises SettingsError when they are damaged."""
    file = folder / f"{name}.toml"
    try:
        data = parse_toml(read_text(file, MOST_BYTES))
        chosen, declared = data["preset"], data.get("overrides", {})
        if not isinstance(chosen, str) or not isinstance(declared, dict):
            raise TypeError("'preset' is no text, or 'overrides' no table")
        overrides = present_keys(declared)
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise SettingsError(
            f"these settings cannot be read: {error}", where=file, cure="Remove the file, and keep them anew."
        ) from error
    with_overrides(overrides, preset(chosen))
    return chosen, overrides


def remove_settings(folder: Path, name: str) -> None:
    """Remove the settings kept under a name. Raises SettingsError when they are not there."""
    file = folder / f"{name}.toml"
    try:
        file.unlink()
    except OSError as error:
        raise SettingsError(
            f"these settings cannot be removed: {error.strerror}", where=file, cure="Choose others."
        ) from error
