"""The folders of what a person keeps for themselves on this machine, outside every scene bundle.

Standard library alone.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .errors import MachineError

CONFIGURATION_VARIABLE = "R2SEGO_CONFIG"
"""Names another folder."""

_NAME = "r2sego"


def configuration_folder() -> Path:
    """The person's folder ``r2sego`` among their programs' settings; it need not be there yet.

    That is ``$R2SEGO_CONFIG`` itself, else in ``$XDG_CONFIG_HOME`` or ``~/.config``, on Windows in ``%APPDATA%``,
    on macOS in ``~/Library/Application Support``. Never a relative one: a program may be started inside a
    bundle. Raises MachineError without a home.
    """
    if (chosen := Path(os.environ.get(CONFIGURATION_VARIABLE, ""))).is_absolute():
        return chosen
    named = Path(os.environ.get("APPDATA" if sys.platform == "win32" else "XDG_CONFIG_HOME", ""))
    if named.is_absolute():
        return named / _NAME
    try:
        home = Path.home()
    except RuntimeError as error:
        raise MachineError("this user has no home folder", cure="Set XDG_CONFIG_HOME to a folder of yours.") from error
    if sys.platform == "win32":
        return home / "AppData" / "Roaming" / _NAME
    return home / ("Library/Application Support" if sys.platform == "darwin" else ".config") / _NAME


def cache_folder() -> Path:
    """The person's folder ``r2sego`` for what can be made again; it need not be there yet.

    Raises RuntimeError without a home.
    """
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / _NAME
