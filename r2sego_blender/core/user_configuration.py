"""The folder of what a person keeps for themselves on this machine, outside every scene bundle.

Standard library alone.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from .errors import MachineError

_NAME = "r2sego"


def configuration_folder() -> Path:
    """The person's folder ``r2sego`` among their programs' settings; it need not be there yet.

    That is ``$XDG_CONFIG_HOME``, else ``~/.config``, on Windows ``%APPDATA%``, on macOS ``~/Library/Application
    Support``. Never a relative one: a program may be started inside a bundle. Raises MachineError without a home.
    """
    for variable in ("XDG_CONFIG_HOME", "APPDATA"):
        named = Path(os.environ.get(variable, ""))
        if named.is_absolute() and (variable != "APPDATA" or sys.platform == "win32"):
            return named / _NAME
    try:
        home = Path.home()
    except RuntimeError as error:
        raise MachineError("this user has no home folder", cure="Set XDG_CONFIG_HOME to a folder of yours.") from error
    if sys.platform == "win32":
        return home / "AppData" / "Roaming" / _NAME
    return home / ("Library/Application Support" if sys.platform == "darwin" else ".config") / _NAME
